/* Reads calls of entries from a file, makes them, and writes back the arrays that they were given: on any processor. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST = 32 };
/* Numbers are whole ones alone, so all arguments are passed alike, and those too many are not looked at. */
typedef int32_t (*entry)(int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t,
                         int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t,
                         int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t);

/* ENTRIES is ENTRY(name) for each of them. */
#define ENTRY(name) extern int32_t sledenv_##name();
ENTRIES
#undef ENTRY
#define ENTRY(name) {#name, (entry)sledenv_##name},
static const struct { const char *name; entry run; } known[] = {ENTRIES};

static void must(size_t done) { if (done != 1) { fprintf(stderr, "the file is cut\n"); exit(2); } }

int main(int count, char **words) {
    static void *nowhere[2];
    FILE *in = fopen(words[1], "rb"), *out = fopen(words[2], "wb");
    if (count != 3 || !in || !out) return 2;
    char name[64];
    while (fread(name, sizeof name, 1, in) == 1) {
        int64_t number, a[MOST] = {(int64_t)nowhere, (int64_t)nowhere}, size[MOST] = {0};
        must(fread(&number, 8, 1, in));
        for (int64_t i = 2; i < number + 2; i++) { /* the size of an array and its bytes, or 0 and a whole number */
            must(fread(&size[i], 8, 1, in));
            if (size[i] > 0) {
                a[i] = (int64_t)aligned_alloc(64, (size[i] + 63) / 64 * 64);
                must(fread((void *)a[i], size[i], 1, in));
            } else must(fread(&a[i], 8, 1, in));
        }
        entry run = 0;
        for (size_t k = 0; k < sizeof known / sizeof *known; k++)
            if (!strcmp(known[k].name, name)) run = known[k].run;
        if (!run || run(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13], a[14], a[15],
                        a[16], a[17], a[18], a[19], a[20], a[21], a[22], a[23], a[24], a[25], a[26], a[27], a[28], a[29],
                        a[30], a[31])) return 3;
        for (int64_t i = 2; i < number + 2; i++)
            if (size[i] > 0) { must(fwrite((void *)a[i], size[i], 1, out)); free((void *)a[i]); }
    }
    return fclose(out);
}

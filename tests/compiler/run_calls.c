/* Reads calls of entries from a file, makes them, and writes back the arrays that they were given: on any processor. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST = 40 };
/* Numbers are whole ones alone, so all arguments are passed alike, and those too many are not looked at. */
#define TEN(of) of, of, of, of, of, of, of, of, of, of
typedef int32_t (*entry)(TEN(int64_t), TEN(int64_t), TEN(int64_t), TEN(int64_t));

#define PASSED(i) a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5], a[i + 6], a[i + 7], a[i + 8], a[i + 9]

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
        if (number + 2 > MOST) { fprintf(stderr, "%s has more than %d arguments\n", name, MOST); return 4; }
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
        if (!run || run(PASSED(0), PASSED(10), PASSED(20), PASSED(30))) return 3;
        for (int64_t i = 2; i < number + 2; i++)
            if (size[i] > 0) { must(fwrite((void *)a[i], size[i], 1, out)); free((void *)a[i]); }
    }
    return fclose(out);
}

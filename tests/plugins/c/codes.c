/* A plugin that checks, from C, what the boundary promises to C callers, and hands over a large mesh.
 *
 *   geometry codes   made only where codes, messages and threads are as the header says
 *   geometry sheet   two sheets of n × n vertices and the hexahedra between them, in memory of its own
 */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "volact.h"

/* The numbers are part of the boundary: they never change. */
#define SAME(name, number) typedef char same_##name[(name) == (number) ? 1 : -1]
SAME(VOLACT_OK, 0);
SAME(VOLACT_BAD_VALUE, 1);
SAME(VOLACT_BAD_NAME, 2);
SAME(VOLACT_OUT_OF_MEMORY, 3);
SAME(VOLACT_UNSUPPORTED, 4);
SAME(VOLACT_PANICKED, 5);
SAME(VOLACT_IO, 6);
SAME(VOLACT_STOPPED, 7);
SAME(VOLACT_BAD_STATE, 8);
SAME(VOLACT_BAD_VERSION, 9);
SAME(VOLACT_FAILED, 10);
SAME(VOLACT_VERSION, 0x00010000);
SAME(VOLACT_KIND_VOLUME, 1);
SAME(VOLACT_KIND_ATTRIBUTE, 12);
SAME(VOLACT_KIND_ARRAY, 32);
SAME(VOLACT_SCALAR_U8, 1);
SAME(VOLACT_SCALAR_I64, 10);
SAME(VOLACT_COMPOSITE_OVER, 1);
SAME(VOLACT_COMPOSITE_FIRST, 6);

static const VolactHost *host;

static int is(VolactText text, const char *words) {
  return text.length == strlen(words) && memcmp(text.data, words, text.length) == 0;
}

static void nothing(void *user, uint64_t index) { (void)user, (void)index; }

static int thread_fails;

/* Another thread: it begins without an error, fails in its own way, and leaves a message of its own. */
static void *other(void *user) {
  (void)user;
  if (host->last_error().length != 0) thread_fails = 1;
  if (host->parallel_for(1, 1, NULL, NULL) != VOLACT_BAD_VALUE) thread_fails = 2;
  if (!is(host->last_error(), "task is null, wanted a function")) thread_fails = 3;
  host->set_error(volact_text("of the other thread"));
  return NULL;
}

static int32_t codes(void *user, VolactParameters parameters, VolactGeometryView *made) {
  pthread_t thread;
  (void)user, (void)parameters;
  if (host->parallel_for(1, 1, NULL, NULL) != VOLACT_BAD_VALUE) return volact_fail(host, VOLACT_FAILED, "no error for a null task");
  if (!is(host->last_error(), "task is null, wanted a function")) return volact_fail(host, VOLACT_FAILED, "another message");
  /* A success leaves the last failure's message as it is. */
  if (host->parallel_for(2, 8, nothing, NULL) != VOLACT_OK) return volact_fail(host, VOLACT_FAILED, "an error for eight tasks");
  if (!is(host->last_error(), "task is null, wanted a function")) return volact_fail(host, VOLACT_FAILED, "a message that went");
  host->set_error(volact_text("of this thread"));
  if (pthread_create(&thread, NULL, other, NULL) != 0) return volact_fail(host, VOLACT_FAILED, "no thread");
  pthread_join(thread, NULL);
  if (thread_fails != 0) return volact_fail(host, VOLACT_FAILED, "the other thread saw what it must not");
  if (volact_number(volact_parameter(parameters, "fail"), 0, 0) != 0) return VOLACT_BAD_STATE;
  made->kind = VOLACT_GEOMETRY_BLOCK;
  made->bounds[3] = made->bounds[4] = made->bounds[5] = 1;
  return VOLACT_OK;
}

static void release(void *owner) { free(owner); }

static VolactArrayView give(uint32_t scalar, void *data, uint32_t rank, uint64_t n0, uint64_t n1) {
  VolactArrayView view = volact_static(scalar, data, rank, n0, n1);
  view.owner = data;
  view.release = release;
  return view;
}

static int32_t sheet(void *user, VolactParameters parameters, VolactGeometryView *made) {
  uint32_t n = (uint32_t)volact_number(volact_parameter(parameters, "n"), 0, 2), i, j, k, count = 0;
  double *points = malloc((size_t)n * n * 2 * 3 * sizeof *points), *point = points;
  uint32_t *cells = malloc((size_t)(n - 1) * (n - 1) * 8 * sizeof *cells);
  (void)user;
  if (points == NULL || cells == NULL) return free(points), free(cells), volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory");
  for (k = 0; k < 2; k++)
    for (j = 0; j < n; j++)
      for (i = 0; i < n; i++) *point++ = i, *point++ = j, *point++ = k;
  for (j = 0; j + 1 < n; j++) {
    for (i = 0; i + 1 < n; i++) {
      for (k = 0; k < 2; k++) {
        uint32_t at = (k * n + j) * n + i;
        cells[count++] = at, cells[count++] = at + 1, cells[count++] = at + n + 1, cells[count++] = at + n;
      }
    }
  }
  made->kind = VOLACT_GEOMETRY_MESH;
  made->cell_type = VOLACT_CELL_HEXAHEDRON;
  made->vertices = give(VOLACT_SCALAR_F64, points, 2, 3, (uint64_t)n * n * 2);
  made->cells = give(VOLACT_SCALAR_U32, cells, 1, count, 0);
  return VOLACT_OK;
}

static const VolactParameterDeclView fail_parameter[] = {
  { VOLACT_TEXT("fail"), VOLACT_TEXT("whether it fails"), { 0, 0 }, VOLACT_BIT(VOLACT_KIND_INT), 0, 0, { 0, 0 }, { 0 }, 0, 0 },
};
static const VolactParameterDeclView n_parameter[] = {
  { VOLACT_TEXT("n"), VOLACT_TEXT("vertices an edge"), { 0, 0 }, VOLACT_BIT(VOLACT_KIND_INT), 1, 1, { 2, 4096 }, { 0 }, 0, 0 },
};
static const VolactGeometryTable codes_table = {
  sizeof codes_table, 0, { VOLACT_TEXT("codes"), VOLACT_TEXT("1"), VOLACT_TEXT("checks"), fail_parameter, 1 }, 0, codes,
};
static const VolactGeometryTable sheet_table = {
  sizeof sheet_table, 0, { VOLACT_TEXT("sheet"), VOLACT_TEXT("1"), VOLACT_TEXT("a sheet"), n_parameter, 1 }, 0, sheet,
};
static const VolactGeometryTable *const geometries[] = { &codes_table, &sheet_table };

static const VolactPlugin plugin = {
  sizeof plugin, 0, VOLACT_TEXT("codes"), VOLACT_TEXT("1"), VOLACT_TEXT("checks codes"), 0, 0, 0, 0, geometries, 2, 0, 0,
};

int32_t volact_plugin_codes(const VolactHost *from, VolactAnswer *answer) {
  host = from;
  return volact_answer(host, answer, &plugin);
}

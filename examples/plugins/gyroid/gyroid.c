/* A loader in C: volumes by a formula, sample by sample, in whatever region is asked for.
 *
 * A file is one line, `GYROID samples periods`, for instance `GYROID 96 3`. The values are those of the gyroid,
 *
 *   sin x cos y + sin y cos z + sin z cos x,
 *
 * over so many periods of a cube with so many samples an edge; 0 is a surface that parts space into two alike
 * halves (A. Schoen, Infinite periodic minimal surfaces without self-intersections, NASA TN D-5541, 1970).
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "volact.h"

static const VolactHost *host;

typedef struct { uint64_t samples; double step; } Gyroid;

static uint32_t probe(void *user, VolactText path, const uint8_t *head, uint64_t length, uint32_t is_folder) {
  (void)user, (void)path;
  return !is_folder && length >= 7 && memcmp(head, "GYROID ", 7) == 0 ? VOLACT_CONFIDENCE_CONTENT : VOLACT_CONFIDENCE_NO;
}

/* A path with a zero at its end, as fopen wants it. */
static FILE *open_file(VolactText path) {
  char *name = malloc(path.length + 1);
  FILE *file;
  if (name == NULL) return NULL;
  memcpy(name, path.data, path.length);
  name[path.length] = 0;
  file = fopen(name, "r");
  free(name);
  return file;
}

static int32_t open(void *user, VolactText path, VolactParameters options, VolactVolumeView *volume, void **reader) {
  unsigned samples = 0;
  double periods = 0;
  int i, found, error;
  Gyroid *made;
  FILE *file = open_file(path);
  (void)user, (void)options;
  error = errno;
  if (file == NULL) return volact_fail(host, VOLACT_IO, strerror(error));
  found = fscanf(file, "GYROID %u %lf", &samples, &periods);
  fclose(file);
  if (found != 2 || samples < 2 || samples > 2048)
    return volact_fail(host, VOLACT_BAD_VALUE, "the line is not GYROID, 2 to 2048 samples, and periods");
  if (!(periods > 0 && periods <= 1e6)) return volact_fail(host, VOLACT_BAD_VALUE, "the periods are not above 0 and up to 1e6");
  made = malloc(sizeof *made);
  if (made == NULL) return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for a reader");
  made->samples = samples;
  made->step = 2 * 3.14159265358979323846 * periods / (samples - 1);
  volume->scalar = VOLACT_SCALAR_F32;
  volume->components = 1;
  for (i = 0; i < 3; i++) volume->dims[i] = samples;
  /* A cube of edge 1. */
  for (i = 0; i < 3; i++) volume->spacing[i] = 1.0 / (samples - 1);
  *reader = made;
  return VOLACT_OK;
}

static void release(void *voxels) { free(voxels); }

static int32_t read_region(void *reader, const VolactRegionView *region, const VolactProgressView *progress, VolactArrayView *voxels) {
  const Gyroid *self = reader;
  uint64_t n[3], x, y, z;
  float *data, *next;
  int i;
  for (i = 0; i < 3; i++) n[i] = region->max[i] - region->min[i] + 1;
  data = next = malloc(n[0] * n[1] * n[2] * sizeof *data);
  if (data == NULL) return volact_fail(host, VOLACT_OUT_OF_MEMORY, "no memory for voxels");
  for (z = region->min[2]; z <= region->max[2]; z++) {
    for (y = region->min[1]; y <= region->max[1]; y++) {
      for (x = region->min[0]; x <= region->max[0]; x++) {
        double a = self->step * x, b = self->step * y, c = self->step * z;
        *next++ = (float)(sin(a) * cos(b) + sin(b) * cos(c) + sin(c) * cos(a));
      }
    }
    if (!progress->advance(progress->user, (z - region->min[2] + 1) * n[0] * n[1] * sizeof *data, n[0] * n[1] * n[2] * sizeof *data)) {
      free(data);
      return volact_fail(host, VOLACT_STOPPED, "stopped");
    }
  }
  /* Handed over without a copy: the host calls `release` when nobody uses the voxels any more. */
  *voxels = volact_static(VOLACT_SCALAR_F32, data, 1, n[0] * n[1] * n[2], 0);
  voxels->owner = data;
  voxels->release = release;
  return VOLACT_OK;
}

static void close(void *reader) { free(reader); }

static const VolactLoaderTable loader = {
  sizeof loader, VOLACT_CONTENT_VOLUME,
  { VOLACT_TEXT("gyroid"), VOLACT_TEXT("1.0"), VOLACT_TEXT("gyroids by their formula"), NULL, 0 },
  NULL, probe, open, read_region, NULL, NULL, close, NULL,
};
static const VolactLoaderTable *const loaders[] = { &loader };

static const VolactPlugin plugin = {
  sizeof plugin, 0, VOLACT_TEXT("gyroid"), VOLACT_TEXT("1.0"), VOLACT_TEXT("volumes by a formula"),
  NULL, 0, NULL, 0, NULL, 0, loaders, 1,
};

int32_t volact_plugin_gyroid(const VolactHost *from, VolactAnswer *answer) {
  host = from;
  return volact_answer(host, answer, &plugin);
}

/* The plugin of kit.c, which makes the file MARK as soon as its code runs. */
#include "kit.c"

__attribute__((constructor)) static void mark(void) {
  FILE *file = fopen(MARK, "w");
  if (file != NULL) fclose(file);
}

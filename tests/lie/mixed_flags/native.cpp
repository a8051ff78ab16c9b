#define LIESTAT_UNIT NativeUnit
#include "operations.inc"

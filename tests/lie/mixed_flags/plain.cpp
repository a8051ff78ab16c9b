#define LIESTAT_UNIT PlainUnit
#include "operations.inc"

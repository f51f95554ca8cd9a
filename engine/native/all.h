/* Every kernel, once for each instruction set. */
#include "vectors.h"
#include "monitors.h"
#include "plant.h"
#undef NAME
#undef LANES

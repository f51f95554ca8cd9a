/* Every kernel, once for each instruction set. */
#include "monitors.h"
#include "plant.h"
#undef NAME
#undef LANES

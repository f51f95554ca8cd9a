/* Every kernel, once for each instruction set. */
#include "plant.h"

/* An agent, so that its size can be read from the object file. */

#include "splinefleet.h"

sf_agent agent;

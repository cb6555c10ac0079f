// The lane code for every processor; the compiler's flags for this file stand in CMakeLists.txt.
#define THERMID_LANES baseline
#define THERMID_LANE_CODE LANES_BASELINE
#include "ensemble/ensemble_lanes.inc"

// The lane code for processors with AVX2 and FMA; the compiler's flags for this file stand in CMakeLists.txt.
#if defined(THERMID_X86_LANES)
#define THERMID_LANES avx2
#define THERMID_LANE_CODE LANES_AVX2
#include "ensemble/ensemble_lanes.inc"
#endif

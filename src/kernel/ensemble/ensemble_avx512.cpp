// The lane code for processors with AVX-512; the compiler's flags for this file stand in CMakeLists.txt.
#if defined(THERMID_X86_LANES)
#define THERMID_LANES avx512
#define THERMID_LANE_CODE LANES_AVX512
#include "ensemble/ensemble_lanes.inc"
#endif

// This file is included before tests that rely on exact signs. The pragma in the file forbids the compiler to contract
// any later expression to fma.

#ifndef FAST_MATH
#error "FAST_MATH: 0 or 1: whether math = fast"
#endif
#if FAST_MATH
#error "the watertight test needs exact signs, which fast math does not keep"
#endif
#pragma OPENCL FP_CONTRACT OFF

// This file is included before ray-triangle tests that need exact signs of the numbers that they compute. The pragma
// forbids the compiler to contract products and sums in later code to fma, which rounds only once.

#ifndef FAST_MATH
#error "FAST_MATH: 0 or 1: whether math = fast"
#endif
#if FAST_MATH
#error "a test that includes exact_signs.cl needs exact signs, which math = fast does not preserve: use math = strict"
#endif
#pragma OPENCL FP_CONTRACT OFF

// Included before ray-triangle tests that need exact signs. The pragma forbids contraction to fma in later code. With
// fma, only one of the two products in a b - c d is rounded. The values of a b - c d and c d - a b may then differ in
// more than their sign.

#ifndef FAST_MATH
#error "FAST_MATH: 0 or 1: whether math = fast"
#endif
#if FAST_MATH
#error "a test that includes exact_signs.cl needs exact signs, which math = fast does not preserve: use math = strict"
#endif
#pragma OPENCL FP_CONTRACT OFF

// The time of this kernel, which does almost no work, is the cost of starting a kernel.

__kernel void nothing(__global int *out, const int mark) { out[0] = mark; }

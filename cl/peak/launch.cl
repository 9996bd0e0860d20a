// Next to nothing: what remains is the cost of launching it.

__kernel void nothing(__global int *out, const int mark) { out[0] = mark; }

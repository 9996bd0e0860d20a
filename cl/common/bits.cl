// Converts a mask (a truth value per lane) to the bits of a word: bit i is set if the mask is set in lane i.

// A mask has -1 in the lanes that are set, and 0 in all others. The conversion to bits replaces each set lane i by 2^i,
// and then joins all lanes by a bitwise or:
//     mask    -1  0  0 -1  0 -1 ...
//     and      1  2  4  8 16 32 ...
//     gives    1  0  0  8  0 32 ...  ->  or: 41 = 0b101001
#if REDUCE_BUILTIN && defined(__AVX512DQ__) && defined(__AVX512VL__)
// AVX-512 converts a mask to bits in one instruction. Compilers do not choose AVX-512's instruction by themselves, so
// LANE_BITS8 and LANE_BITS16 call the compiler's built-in function for the instruction.
typedef int Hardware8 __attribute__((__vector_size__(32)));
typedef int Hardware16 __attribute__((__vector_size__(64)));
#define LANE_BITS8(mask) ((uint)(uchar)__builtin_ia32_cvtd2mask256(__builtin_astype(mask, Hardware8)))
#define LANE_BITS16(mask) ((uint)(ushort)__builtin_ia32_cvtd2mask512(__builtin_astype(mask, Hardware16)))
#else
#ifdef HAS_REDUCE_OR
#define ANY8(mask) __builtin_reduce_or(mask)
#else
#define ANY8(mask) or_of_8(mask)
#endif
#define LANE_BITS8(mask) ((uint)ANY8((mask) & (int8)(1, 2, 4, 8, 16, 32, 64, 128)))
#define LANE_BITS16(mask) \
    ((uint)ANY((mask) & (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768)))
#endif

// LOWEST_BIT returns the index of the lowest set bit. Compilers turn LOWEST_BIT into a count of trailing zeros.
#define LOWEST_BIT(bits) ((int)popcount(~(bits) & ((bits) - 1)))

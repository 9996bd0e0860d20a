// A varying holds one value for each of the WIDTH rays that a work-item casts side by side, as in ISPC. The same code
// thus serves GPUs, where a work-item may cast a single ray, and CPUs, where the rays are the lanes of vector
// registers. With WIDTH 1, a Mask is 0 or 1; otherwise it is 0 or -1 in each lane. Combine masks with & and |, and
// negate a mask with !.

#ifndef WIDTH
#error "WIDTH: rays that a work-item casts side by side: 1, 2, 4, 8 or 16"
#endif
#ifndef BLOCK_X
#error "BLOCK_X: number of a work-item's rays in a row of pixels"
#endif
#ifndef REDUCE_BUILTIN
#error "REDUCE_BUILTIN: 1 to use the compiler's __builtin_reduce_or where it has one, 0 to avoid it"
#endif

#if WIDTH == 1
typedef float varying;
typedef int varying_int;
#define LANE_NUMBER 0
#elif WIDTH == 2
typedef float2 varying;
typedef int2 varying_int;
#define LANE_NUMBER ((int2)(0, 1))
#elif WIDTH == 4
typedef float4 varying;
typedef int4 varying_int;
#define LANE_NUMBER ((int4)(0, 1, 2, 3))
#elif WIDTH == 8
typedef float8 varying;
typedef int8 varying_int;
#define LANE_NUMBER ((int8)(0, 1, 2, 3, 4, 5, 6, 7))
#elif WIDTH == 16
typedef float16 varying;
typedef int16 varying_int;
#define LANE_NUMBER ((int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#else
#error "WIDTH must be 1, 2, 4, 8 or 16"
#endif

typedef varying_int Mask;

// The height of the block of pixels that the lanes of a work-item cover, and the lanes' positions in this block.
#define BLOCK_Y (WIDTH / BLOCK_X)
#define LANE_X (LANE_NUMBER % BLOCK_X)
#define LANE_Y (LANE_NUMBER / BLOCK_X)

// Lanes and IntLanes give access to single lanes of a vector, in order to gather and scatter.
typedef union {
    varying all;
    float each[WIDTH];
} Lanes;
typedef union {
    varying_int all;
    int each[WIDTH];
} IntLanes;

#define SELECT(mask, yes, no) ((mask) ? (yes) : (no))

// ANY(mask) is not 0 if at least one lane is set. OpenCL's any() is not used: some compilers for CPUs turn it into tens
// of scalar instructions.
#ifdef __has_builtin
#if REDUCE_BUILTIN && __has_builtin(__builtin_reduce_or)
#define HAS_REDUCE_OR
#endif
#endif

#define PASTE2(a, b) a##b
#define PASTE(a, b) PASTE2(a, b)

#if WIDTH == 1
#define ANY(mask) (mask)
#elif defined(HAS_REDUCE_OR)
#define ANY(mask) __builtin_reduce_or(mask)
#else // or_of_2 and so on: names that no compiler's header defines as macros
static int or_of_2(int2 m) { return m.x | m.y; }
static int or_of_4(int4 m) { return or_of_2(m.lo | m.hi); }
static int or_of_8(int8 m) { return or_of_4(m.lo | m.hi); }
static int or_of_16(int16 m) { return or_of_8(m.lo | m.hi); }
#define ANY(mask) PASTE(or_of_, WIDTH)(mask)
#endif

// ALL_NEGATIVE(bits) is 1 if every lane has its sign bit set, else 0.
#if WIDTH == 1
#define ALL_NEGATIVE(bits) ((bits) < 0)
#elif defined(HAS_REDUCE_OR)
#define ALL_NEGATIVE(bits) (!ANY((bits) >= 0))
#else
static int and_of_2(int2 m) { return m.x & m.y; }
static int and_of_4(int4 m) { return and_of_2(m.lo & m.hi); }
static int and_of_8(int8 m) { return and_of_4(m.lo & m.hi); }
static int and_of_16(int16 m) { return and_of_8(m.lo & m.hi); }
#define ALL_NEGATIVE(bits) (PASTE(and_of_, WIDTH)(bits) < 0)
#endif

// sign_bit(a) returns the sign bits of `a`, and 0 in all other bits. flip_sign(a, sign) changes the sign of `a` in the
// lanes in which `sign` has its sign bit set, like a multiplication by 1 or -1.
#if WIDTH == 1
#define AS_INT(a) as_int(a)
#define AS_FLOAT(a) as_float(a)
#elif WIDTH == 2
#define AS_INT(a) as_int2(a)
#define AS_FLOAT(a) as_float2(a)
#elif WIDTH == 4
#define AS_INT(a) as_int4(a)
#define AS_FLOAT(a) as_float4(a)
#elif WIDTH == 8
#define AS_INT(a) as_int8(a)
#define AS_FLOAT(a) as_float8(a)
#else
#define AS_INT(a) as_int16(a)
#define AS_FLOAT(a) as_float16(a)
#endif

static varying_int sign_bit(varying a) { return AS_INT(a) & (varying_int)(int)0x80000000; }
static varying flip_sign(varying a, varying_int sign) { return AS_FLOAT(AS_INT(a) ^ sign); }

// Loads rows of floats into columns (vectors): the same row for all lanes of a vector, or one row for each lane.

// INLINED functions take or return columns of values. Inlining keeps the columns in registers.
#define INLINED static __attribute__((always_inline))

// A row has three parts: a triangle's three corners, or its three normals. Each part begins `step` floats after the
// previous part. The first three floats of a row's part are a corner or a normal. After a corner, the part's fourth
// float is a word that is stored beside the corner (see LEAF_ROW). After a normal, the fourth float is the first float
// of the next normal. (Even the last of all normals is followed by a float, since the host allocates one more row.)
//
//     leaves, step 4:    v0.x v0.y v0.z number v1.x v1.y v1.z material v2.x v2.y v2.z 0
//     surfaces, step 3:  n0.x n0.y n0.z n1.x n1.y n1.z n2.x n2.y n2.z

// Loads a row (three corners or normals), and returns its numbers as 12 vectors, each with one value in all lanes.
INLINED void spread_row(const __global float *row, int step, varying *column) {
    for (int part = 0; part < 3; part++) {
        const float4 four = vload4(0, row + step * part);
        column[4 * part] = (varying)(four.x), column[4 * part + 1] = (varying)(four.y);
        column[4 * part + 2] = (varying)(four.z), column[4 * part + 3] = (varying)(four.w);
    }
}

// Loads four floats for each of four lanes: `lane` and the next three. `at` has the lanes' offsets in floats.
#define FOUR_QUADS(from, at, lane)                                                                             \
    (float16)(vload4(0, from + at[lane]), vload4(0, from + at[lane + 1]), vload4(0, from + at[lane + 2]),       \
              vload4(0, from + at[lane + 3]))

// Transposes 16 quads (of four floats each) in four registers into 4 columns (vectors). Separating even and odd lanes
// twice transposes the quads:
//
//     x y z w, x y z w, ...  ->  even: x z x z ...,  odd: y w y w ...  ->  x x x ..., z z z ..., y y y ..., w w w ...
INLINED void transpose_quads(float16 a, float16 b, float16 c, float16 d, varying *column) {
    const float16 xz = (float16)(a.even, b.even), xz2 = (float16)(c.even, d.even);
    const float16 yw = (float16)(a.odd, b.odd), yw2 = (float16)(c.odd, d.odd);
    column[0] = (float16)(xz.even, xz2.even);
    column[1] = (float16)(yw.even, yw2.even);
    column[2] = (float16)(xz.odd, xz2.odd);
    column[3] = (float16)(yw.odd, yw2.odd);
}

// Loads a row (three corners or normals) for each lane, and returns the rows' floats as 12 columns (vectors) with one
// value per lane. Each lane loads a quad (four floats: a row's part) at once; the quads are transposed in registers.
void gather_rows(const __global float *rows, int step, varying_int indices, varying *column) {
    IntLanes at;
    at.all = indices * (3 * step);
    for (int quad = 0; quad < 3; quad++) {
        const __global float *from = rows + step * quad;
        transpose_quads(FOUR_QUADS(from, at.each, 0), FOUR_QUADS(from, at.each, 4), FOUR_QUADS(from, at.each, 8),
                        FOUR_QUADS(from, at.each, 12), column + 4 * quad);
    }
}

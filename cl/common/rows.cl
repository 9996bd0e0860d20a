// The types of a triangle's data: its corners, the row that a ray-triangle test reads, and the surface that shading
// reads. The types are the same for all layouts of triangles.

typedef struct {
    Uniform3 a, b, c;
} Corners;

// A row consists of the floats that a ray-triangle test reads of one triangle. These floats are computed from the
// triangle's corners. Floats that describe planes through the rays' common origin also depend on this origin.
// RECORD_FLOATS, stated in the header of the test's file, is the number of floats. In memory, a row consists of
// ROW_UNITS values of type ROW_UNIT.
#ifndef RECORD_FLOATS
#error "RECORD_FLOATS: number of floats in a row, as record_floats in the header of the test's file says"
#endif
#if RECORD_FLOATS == 12
typedef struct {
    Uniform3 a, b, c;
    float u, v, w;
} Row;

// In memory, a row is three float4, aligned to 16 bytes:
//
//     | a.x a.y a.z u | b.x b.y b.z v | c.x c.y c.z w |
#define ROW_UNIT float4
#define ROW_UNITS 3
#define LOAD_ROW(row, quads)                                     \
    {                                                              \
        const float4 a = (quads)[0], b = (quads)[1], c = (quads)[2]; \
        row.a = uniform3(a.x, a.y, a.z), row.u = a.w;                \
        row.b = uniform3(b.x, b.y, b.z), row.v = b.w;                \
        row.c = uniform3(c.x, c.y, c.z), row.w = c.w;                \
    }
#define STORE_ROW(row, quads)                                       \
    (quads)[0] = (float4)((row).a.x, (row).a.y, (row).a.z, (row).u); \
    (quads)[1] = (float4)((row).b.x, (row).b.y, (row).b.z, (row).v); \
    (quads)[2] = (float4)((row).c.x, (row).c.y, (row).c.z, (row).w);
#else
typedef struct {
    float number[RECORD_FLOATS];
} Row;

#define ROW_UNIT float
#define ROW_UNITS RECORD_FLOATS
#define LOAD_ROW(row, numbers) \
    for (int i = 0; i < RECORD_FLOATS; i++) row.number[i] = (numbers)[i];
#define STORE_ROW(row, numbers) \
    for (int i = 0; i < RECORD_FLOATS; i++) (numbers)[i] = (row).number[i];
#endif

// The data that shading reads of each lane's triangle.
typedef struct {
    Vec3 n0, n1, n2;         // the normals at the triangle's corners
    Vec3 lambertian, glossy; // the material's reflectances: k_L (diffuse) and k_G (of its highlight)
    varying shininess, kind; // s, the exponent of the highlight; kind is 1 if the material has a highlight, else 0
#if EMISSIVE
    Vec3 emitted;             // the radiance that the surface emits
    varying emission_texture; // the number of the texture that this radiance is multiplied by, plus 1; 0 for none
#endif
} Surface;

#define FLOATS_OF_SURFACE (9 + MATERIAL_FLOATS)

// Returns a Surface from columns, which are vectors with one lane per ray: 9 columns for normals, 3 for k_L, 3 for k_G,
// one for s, one for kind. With EMISSIVE, 3 columns for the emitted radiance and one for its texture follow.
static Surface surface_of(const Lanes *column) {
    // The columns are in the order in which `layout = soup` stores a triangle's normals and material.
    Surface s;
    s.n0 = vec3(column[0].all, column[1].all, column[2].all);
    s.n1 = vec3(column[3].all, column[4].all, column[5].all);
    s.n2 = vec3(column[6].all, column[7].all, column[8].all);
    s.lambertian = vec3(column[9].all, column[10].all, column[11].all);
    s.glossy = vec3(column[12].all, column[13].all, column[14].all);
    s.shininess = column[15].all;
    s.kind = column[16].all;
#if EMISSIVE
    s.emitted = vec3(column[17].all, column[18].all, column[19].all);
    s.emission_texture = column[20].all;
#endif
    return s;
}

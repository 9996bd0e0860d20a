// What a test finds, and what a traversal keeps.

#define FAR MAXFLOAT        // not infinity: fast math may assume there is none
#define NO_HIT 0x7fffffff   // the triangle of a ray that hits nothing

// A few roundings of single precision, relative to the largest term.
#define ROUNDING 1.2e-7f
// The part of it by which planes of a light's origin let triangles overlap where neighbours do not share their edges'
// planes: on the long way from a light all of it darkens what lies beside a grazed edge. (Measured: with a quarter a pixel
// of eight million is dark on terrain, with a sixteenth two of 60,516 rays at edges slip through; with an eighth neither.)
#define SHADOW_SLACK 0.125f

typedef struct {
    Mask lanes;     // those whose ray hits
    varying t;      // distance along the unit direction
    varying w1, w2; // barycentric weights of the second and third corner
} Hit;

typedef struct {
    varying t;
    varying_int triangle;
} Nearest;

// What a test finds, and what a traversal keeps.

#define FAR MAXFLOAT        // not infinity: fast math may assume there is none
#define NO_HIT 0x7fffffff   // the triangle of a ray that hits nothing

// A few roundings of single precision, relative to the largest term.
#define ROUNDING 1.2e-7f

typedef struct {
    varying t;      // distance along the unit direction
    varying w1, w2; // barycentric weights of the second and third corner
} Hit;

typedef struct {
    varying t;
    varying_int triangle;
} Nearest;

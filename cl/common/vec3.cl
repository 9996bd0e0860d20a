// Three-component vectors: a Vec3 has one value per lane, a Uniform3 one value for all lanes.

typedef struct {
    varying x, y, z;
} Vec3;

typedef struct {
    float x, y, z;
} Uniform3;

static Vec3 vec3(varying x, varying y, varying z) {
    Vec3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}

static Vec3 splat(Uniform3 u) { return vec3((varying)(u.x), (varying)(u.y), (varying)(u.z)); } // the same in all lanes
static Vec3 add(Vec3 a, Vec3 b) { return vec3(a.x + b.x, a.y + b.y, a.z + b.z); }
static Vec3 subtract(Vec3 a, Vec3 b) { return vec3(a.x - b.x, a.y - b.y, a.z - b.z); }
static Vec3 multiply(Vec3 a, Vec3 b) { return vec3(a.x * b.x, a.y * b.y, a.z * b.z); }
static Vec3 scale(Vec3 a, varying s) { return vec3(a.x * s, a.y * s, a.z * s); }
static Vec3 negate(Vec3 a) { return vec3(-a.x, -a.y, -a.z); }
static varying dot3(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static Vec3 cross3(Vec3 a, Vec3 b) {
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

// Returns origin + t * direction.
static Vec3 along(Vec3 origin, varying t, Vec3 direction) {
    return vec3(origin.x + t * direction.x, origin.y + t * direction.y, origin.z + t * direction.z);
}

// Returns the unit vector in the direction of `a`, or zero if the squared length of `a` is 0.
static Vec3 normalize_or_zero(Vec3 a) {
    // Lanes with a squared length of 0 divide by zero; SELECT drops the result of this division.
    const varying squared = dot3(a, a);
    return scale(a, SELECT(squared > 0.0f, 1.0f / sqrt(squared), (varying)(0.0f)));
}

static Vec3 select3(Mask mask, Vec3 yes, Vec3 no) {
    return vec3(SELECT(mask, yes.x, no.x), SELECT(mask, yes.y, no.y), SELECT(mask, yes.z, no.z));
}

static Uniform3 uniform3(float x, float y, float z) {
    Uniform3 u;
    u.x = x;
    u.y = y;
    u.z = z;
    return u;
}

static Uniform3 uniform_difference(Uniform3 a, Uniform3 b) { return uniform3(a.x - b.x, a.y - b.y, a.z - b.z); }
static Uniform3 uniform_scale(Uniform3 a, float s) { return uniform3(a.x * s, a.y * s, a.z * s); }
static float uniform_dot(Uniform3 a, Uniform3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static float uniform_size(Uniform3 a) { return fabs(a.x) + fabs(a.y) + fabs(a.z); } // the 1-norm

static Uniform3 uniform_cross(Uniform3 a, Uniform3 b) {
    return uniform3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

// Returns the first three numbers at a pointer of any address space.
#define LOAD3(pointer) uniform3((pointer)[0], (pointer)[1], (pointer)[2])

// meaning: private arrays, which compilers can keep in registers
// memory: private
// bytes_per_ray: 108
//
// The working vectors are private arrays. All indices are constants, so compilers can keep the arrays in registers.

typedef struct {
    varying vector[WORKING_VECTORS][3];
} Working;

#define WORKING_LOCALS
#define BIND_WORKING(working)

static Vec3 working_get(const Working *working, int which) {
    return vec3(working->vector[which][0], working->vector[which][1], working->vector[which][2]);
}

static void working_set(Working *working, int which, Vec3 value) {
    working->vector[which][0] = value.x;
    working->vector[which][1] = value.y;
    working->vector[which][2] = value.z;
}

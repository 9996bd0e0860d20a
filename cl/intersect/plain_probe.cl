// Of a ray whose test prepares nothing, all there is to know.

typedef struct {
    varying t_min;
} Probe;

Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    return probe;
}

// meaning: edge planes through the eye or the light, prepared once per frame
// record_floats: 12
// prepared_for: origin
// exact_signs: no
// operations: 9
// contradicts: epsilons=paper because the paper's epsilons are numbers of the moller-trumbore test
//
// Tests rays with a common origin against planes that contain this origin and an edge. Up to the point where most
// misses are found, the test takes 3 operations for each of three planes.

#include "cast/planes_of_origin.cl"

// meaning: edge planes through the eye or the light, prepared once per frame
// record_floats: 12
// prepared_for: origin
// exact_signs: no
// operations: 9
// contradicts: epsilons=paper because the paper's epsilons are numbers of the moller-trumbore test
//
// This ray-triangle test is for rays with a common origin. Each edge of a triangle has a plane, which contains the edge
// and the rays' origin. Most misses are found after at most 9 operations: 3 for each of the three planes.

#include "cast/planes_of_origin.cl"

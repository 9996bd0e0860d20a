// meaning: edge planes through the eye or the light, prepared once per frame
// record_floats: 12
// prepared_for: origin
// exact_signs: no
// operations: 9
// contradicts: epsilons=paper because they are numbers of the moller-trumbore test
//
// Rays of a common origin, and planes seen from it. Operations: three planes of 3.

#include "cast/planes_of_origin.cl"

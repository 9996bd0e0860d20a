// Rays of a common origin, and planes seen from it.

#include "cast/planes_of_origin.cl"

// Where triangles are read from: the whole scene copied to __local memory once a work-group: the paper's optimisation 2.

#define SOURCE_SPACE __global
#define STAGE_VERTICES 1
#define STAGE_NORMALS 1
#define STAGE_MATERIALS 1
#define STREAM_TILES 0

// The size of the work-groups that kernels are compiled for. The host generates each kernel's parameter list, for
// example CAST_FRAME_PARAMETERS of cast_frame, from src/manifest/.

#if !defined(LOCAL_X) || !defined(LOCAL_Y)
#error "LOCAL_X, LOCAL_Y: work-items of a work-group across and down"
#endif

#define GROUP_SHAPE __attribute__((reqd_work_group_size(LOCAL_X, LOCAL_Y, 1)))

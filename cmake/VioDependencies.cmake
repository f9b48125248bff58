# What users of the library need too; the installed package includes this file.
include(CMakeFindDependencyMacro)
find_dependency(Eigen3)
find_dependency(OpenCVModules COMPONENTS core imgproc imgcodecs video videoio features2d calib3d)
find_dependency(mrpt-obs)
find_dependency(mrpt-maps)
find_dependency(mrpt-opengl)
find_dependency(mrpt-topography)

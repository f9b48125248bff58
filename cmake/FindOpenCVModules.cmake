# Targets opencv_<component> for the components asked for.
#
# OpenCV's own package file is used where it is installed. Debian ships it only in libopencv-dev,
# which needs every module and with them VTK and Java (over 1 GB); the modules' own -dev packages
# are enough here.
find_package(OpenCV 4 CONFIG QUIET COMPONENTS ${OpenCVModules_FIND_COMPONENTS})
if(OpenCV_FOUND)
  set(OpenCVModules_FOUND TRUE)
  return()
endif()

find_path(OpenCVModules_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4)
set(required_vars OpenCVModules_INCLUDE_DIR)
foreach(component ${OpenCVModules_FIND_COMPONENTS})
  find_library(OpenCVModules_${component}_LIBRARY opencv_${component})
  list(APPEND required_vars OpenCVModules_${component}_LIBRARY)
endforeach()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenCVModules REQUIRED_VARS ${required_vars})

if(OpenCVModules_FOUND)
  foreach(component ${OpenCVModules_FIND_COMPONENTS})
    if(NOT TARGET opencv_${component})
      add_library(opencv_${component} SHARED IMPORTED)
      set_target_properties(opencv_${component} PROPERTIES
        IMPORTED_LOCATION ${OpenCVModules_${component}_LIBRARY}
        INTERFACE_INCLUDE_DIRECTORIES ${OpenCVModules_INCLUDE_DIR})
    endif()
  endforeach()
endif()

# The Debian package: cmake --workflow --preset package
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME vio-slam)
set(CPACK_PACKAGE_VENDOR "vio-slam developers")
# Whoever passes packages on puts an address of his own here.
set(VIO_PACKAGE_CONTACT "vio-slam developers <vio-slam@localhost>" CACHE STRING
    "Maintainer of the Debian package")
set(CPACK_PACKAGE_CONTACT "${VIO_PACKAGE_CONTACT}")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "motion estimation from a camera and an IMU for MRPT")
set(CPACK_PACKAGE_DESCRIPTION
"Six-degree-of-freedom motion, sparse structure, gravity, velocity and
sensor biases from one camera and an IMU, read from MRPT rawlogs: a batch
optimiser and a recursive filter, tools to import, calibrate, simulate,
evaluate and to draw results without a display, and the C++ library that
they are made of.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR})

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS
    ${PROJECT_BINARY_DIR}/libvio ${PROJECT_BINARY_DIR}/gui_offscreen)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
file(WRITE ${PROJECT_BINARY_DIR}/triggers "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${PROJECT_BINARY_DIR}/triggers)
# Pictures without a display; fast dense kernels; plots of reports.
set(CPACK_DEBIAN_PACKAGE_DEPENDS "libegl1, libgl1-mesa-dri")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "libopenblas0-pthread, gnuplot-nox")
# To build against the library, and to convert ROS bags and look at rawlogs.
set(CPACK_DEBIAN_PACKAGE_SUGGESTS
    "libmrpt-obs-dev, libmrpt-maps-dev, libmrpt-bayes-dev, libmrpt-topography-dev, libopencv-dev, nlohmann-json3-dev, mrpt-apps")

# A changelog is part of every Debian package; its date is that of the last commit.
execute_process(COMMAND git log -1 --format=%cD WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
                OUTPUT_VARIABLE vio_date OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT vio_date)
  set(vio_date "Thu, 01 Jan 1970 00:00:00 +0000")
endif()
file(WRITE ${PROJECT_BINARY_DIR}/changelog
"vio-slam (${PROJECT_VERSION}) bookworm; urgency=medium

  * Built from the project's sources.

 -- ${CPACK_PACKAGE_CONTACT}  ${vio_date}
")
execute_process(COMMAND gzip --force --best --no-name ${PROJECT_BINARY_DIR}/changelog)
install(FILES ${PROJECT_BINARY_DIR}/changelog.gz DESTINATION ${CMAKE_INSTALL_DOCDIR})

include(CPack)

# API documentation: cmake --build build/release --target doc; in doc/html of the build tree. A
# warning is an error.
find_program(VIO_DOXYGEN doxygen)
if(VIO_DOXYGEN)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/Doxyfile.in ${PROJECT_BINARY_DIR}/Doxyfile @ONLY)
  add_custom_target(doc COMMAND ${VIO_DOXYGEN} ${PROJECT_BINARY_DIR}/Doxyfile VERBATIM)
endif()

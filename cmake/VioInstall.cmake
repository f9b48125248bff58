# Program, libraries, headers, data, and the package file for find_package(vio).
include(CMakePackageConfigHelpers)

set(vio_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/vio)
install(TARGETS vio vio_gui_offscreen EXPORT vio-targets)
install(TARGETS vio-slam vio_mrpt_plugin)
install(EXPORT vio-targets NAMESPACE vio:: DESTINATION ${vio_package_dir})
foreach(room libvio gui_offscreen)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${room}
          DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/vio-slam FILES_MATCHING PATTERN "*.h")
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/share/ DESTINATION ${CMAKE_INSTALL_DATADIR}/vio-slam)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/datasets DESTINATION ${CMAKE_INSTALL_DATADIR}/vio-slam)
install(FILES ${PROJECT_SOURCE_DIR}/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
# Debian's name for it.
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright)

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/vio-config.cmake.in
  ${PROJECT_BINARY_DIR}/vio-config.cmake INSTALL_DESTINATION ${vio_package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/vio-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES
  ${PROJECT_BINARY_DIR}/vio-config.cmake ${PROJECT_BINARY_DIR}/vio-config-version.cmake
  ${CMAKE_CURRENT_LIST_DIR}/VioDependencies.cmake ${CMAKE_CURRENT_LIST_DIR}/FindOpenCVModules.cmake
  ${CMAKE_CURRENT_LIST_DIR}/FindCAMD.cmake
  DESTINATION ${vio_package_dir})

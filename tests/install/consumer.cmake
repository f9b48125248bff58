# Installs the build tree, builds the example program against what was installed, and lets it follow
# the demo recording: its poses must be those of the installed `vio-slam run`.
#   cmake -D BUILD=build-tree -D SOURCE=source-tree -D WORK=folder -P consumer.cmake
function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result OUTPUT_VARIABLE out ERROR_VARIABLE err)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "failed: ${ARGV}\n${out}\n${err}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${WORK})
set(prefix ${WORK}/prefix)
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
run(${CMAKE_COMMAND} -S ${prefix}/share/vio-slam/examples -B ${WORK}/build
    -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_BUILD_TYPE=Release)
run(${CMAKE_COMMAND} --build ${WORK}/build)

file(GLOB program ${prefix}/bin/vio-slam)
run(${program} run ${SOURCE}/datasets/demo.rawlog --output ${WORK}/run)
run(${WORK}/build/follow_motion vio::RecursiveEstimator ${SOURCE}/datasets/demo.rawlog
    ${SOURCE}/datasets/demo.calibration.ini)
file(WRITE ${WORK}/followed.tum "${out}")
string(REGEX MATCHALL "\n" poses "${out}")
list(LENGTH poses poses)
# The start may wait for two prefixes, 120 of the 152 images, until gravity is known; the poses of the
# last two message windows, 0.2 s, come with the end.
if(poses LESS 24)
  message(FATAL_ERROR "only ${poses} poses came one by one")
endif()
run(${program} evaluate ${WORK}/run --against ${WORK}/followed.tum --align none --max-gap 0.05
    --json)
string(JSON worst GET "${out}" position_m max)
string(JSON worst_deg GET "${out}" rotation_deg max)
message(STATUS "${poses} poses; differences up to ${worst} m, ${worst_deg} deg")
if(worst GREATER 1e-6 OR worst_deg GREATER 1e-4)
  message(FATAL_ERROR "the poses differ: ${worst} m, ${worst_deg} deg")
endif()

# Two images make no path: that is told, too.
run(${program} simulate ${SOURCE}/datasets/stress/base.ini --set camera.count=2
    --output ${WORK}/two.rawlog)
execute_process(COMMAND ${WORK}/build/follow_motion vio::RecursiveEstimator ${WORK}/two.rawlog
                ${WORK}/two.calibration.ini RESULT_VARIABLE result ERROR_VARIABLE err)
if(NOT result EQUAL 1 OR NOT err MATCHES "no pose could be estimated")
  message(FATAL_ERROR "a recording without a pose gives ${result}: ${err}")
endif()

# What no estimator is called, and what is no rawlog, is told in one line.
execute_process(COMMAND ${WORK}/build/follow_motion vio::Nonsense x y RESULT_VARIABLE result
                ERROR_VARIABLE err)
if(NOT result EQUAL 1 OR NOT err MATCHES "vio::Nonsense")
  message(FATAL_ERROR "a wrong name gives ${result}: ${err}")
endif()

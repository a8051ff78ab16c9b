# The optional packages: their names here, Debian's names, a header that shows that they are there, and how each is found.
# Read by the project and by the probe (cmake/probe), which must come to the same findings.

macro(liestat_dependency name package header)
  set(LIESTAT_PACKAGE_${name} ${package})
  set(LIESTAT_HEADER_${name} ${header})
  list(APPEND LIESTAT_DEPENDENCIES ${name})
endmacro()

set(LIESTAT_DEPENDENCIES)
liestat_dependency(boost libboost-dev boost/math/distributions.hpp)
liestat_dependency(random123 librandom123-dev Random123/philox.h)
liestat_dependency(xsimd libxsimd-dev xsimd/xsimd.hpp)
liestat_dependency(tbb libtbb-dev tbb/blocked_range.h)
liestat_dependency(mpi libopenmpi-dev mpi.h)
liestat_dependency(ceres libceres-dev ceres/ceres.h)
liestat_dependency(cli11 libcli11-dev CLI/CLI.hpp)
liestat_dependency(fmt libfmt-dev fmt/core.h)
liestat_dependency(json nlohmann-json3-dev nlohmann/json.hpp)
liestat_dependency(yaml libyaml-cpp-dev yaml-cpp/yaml.h)
liestat_dependency(zlib zlib1g-dev zlib.h)
# Bags of ROS (formats/bag.hpp) are read without these, but for what is compressed by them or a database.
liestat_dependency(bz2 libbz2-dev bzlib.h)
liestat_dependency(lz4 liblz4-dev lz4frame.h)
liestat_dependency(zstd libzstd-dev zstd.h)
liestat_dependency(sqlite_library libsqlite3-dev sqlite3.h)
liestat_dependency(gtest libgtest-dev gtest/gtest.h)
liestat_dependency(gmock libgmock-dev gmock/gmock.h)
liestat_dependency(rapidcheck librapidcheck-dev rapidcheck.h)
liestat_dependency(benchmark libbenchmark-dev benchmark/benchmark.h)
liestat_dependency(opencv libopencv-calib3d-dev opencv2/calib3d.hpp)
# Headers for an extension of SQLite (engines/sqlite).
liestat_dependency(sqlite libsqlite3-dev sqlite3ext.h)
# Compared with: the meaning of a covariance in these. Nothing else uses them.
liestat_dependency(kdl liborocos-kdl-dev kdl/frames.hpp)
liestat_dependency(tf2 libtf2-geometry-msgs-dev tf2_geometry_msgs/tf2_geometry_msgs.h)
liestat_dependency(mrpt libmrpt-poses-dev mrpt/poses/CPose3DPDFGaussian.h)

# The rest of the arguments are libraries to link. Imported targets are SYSTEM to their users, so the warnings of these
# packages' headers are not ours.
function(liestat_provide name)
  add_library(liestat_${name} INTERFACE)
  target_link_libraries(liestat_${name} INTERFACE ${ARGN})
endfunction()

# For packages without a usable CMake package: an include directory is all there is to them.
function(liestat_provide_header name)
  find_path(LIESTAT_${name}_INCLUDE_DIR ${LIESTAT_HEADER_${name}})
  mark_as_advanced(LIESTAT_${name}_INCLUDE_DIR)
  if(LIESTAT_${name}_INCLUDE_DIR)
    add_library(liestat_${name} INTERFACE)
    target_include_directories(liestat_${name} SYSTEM INTERFACE ${LIESTAT_${name}_INCLUDE_DIR})
  endif()
endfunction()

# The same of a library and its headers.
function(liestat_provide_library name library)
  find_library(LIESTAT_${name}_LIBRARY ${library})
  mark_as_advanced(LIESTAT_${name}_LIBRARY)
  if(LIESTAT_${name}_LIBRARY)
    liestat_provide_header(${name})
  endif()
  if(TARGET liestat_${name})
    target_link_libraries(liestat_${name} INTERFACE ${LIESTAT_${name}_LIBRARY})
  endif()
endfunction()

# For packages with a CMake package: the first of the targets that it defines.
macro(liestat_provide_package name package)
  find_package(${package} QUIET)
  foreach(liestat_target ${ARGN})
    if(TARGET ${liestat_target} AND NOT TARGET liestat_${name})
      liestat_provide(${name} ${liestat_target})
    endif()
  endforeach()
endmacro()

# Provides the target liestat_<name> when the package is there. A macro: what a package's CMake file sets is for its
# users (MPIEXEC_EXECUTABLE).
macro(liestat_find name)
  # MPI, and what Ceres looks for in its turn, report at length in spite of QUIET.
  set(liestat_log_level ${CMAKE_MESSAGE_LOG_LEVEL})
  set(CMAKE_MESSAGE_LOG_LEVEL WARNING)
  if("${name}" MATCHES "^(boost|random123|xsimd|sqlite)$")
    # FindBoost would ask for a version of Boost that CMake knows, and Debian's xsimd target links a library which its
    # package lacks: their headers are all that is used.
    liestat_provide_header(${name})
  elseif("${name}" STREQUAL "tbb")
    liestat_provide_package(tbb TBB TBB::tbb)
  elseif("${name}" STREQUAL "mpi")
    set(MPI_CXX_SKIP_MPICXX ON)
    find_package(MPI QUIET COMPONENTS CXX)
    # The target exists as soon as a part of MPI is found.
    if(MPI_CXX_FOUND)
      liestat_provide(mpi MPI::MPI_CXX)
      # The C++ bindings left the standard in MPI 3; Open MPI's headers still offer them, with warnings.
      target_compile_definitions(liestat_mpi INTERFACE OMPI_SKIP_MPICXX MPICH_SKIP_MPICXX)
    endif()
  elseif("${name}" STREQUAL "ceres")
    liestat_provide_package(ceres Ceres Ceres::ceres)
  elseif("${name}" STREQUAL "cli11")
    liestat_provide_package(cli11 CLI11 CLI11::CLI11)
  elseif("${name}" STREQUAL "fmt")
    liestat_provide_package(fmt fmt fmt::fmt)
  elseif("${name}" STREQUAL "json")
    liestat_provide_package(json nlohmann_json nlohmann_json::nlohmann_json)
  elseif("${name}" STREQUAL "yaml")
    liestat_provide_package(yaml yaml-cpp yaml-cpp::yaml-cpp yaml-cpp) # the second is the name before 0.8
  elseif("${name}" STREQUAL "zlib")
    liestat_provide_package(zlib ZLIB ZLIB::ZLIB)
  elseif("${name}" MATCHES "^(bz2|lz4|zstd|sqlite_library)$")
    string(REPLACE sqlite_library sqlite3 liestat_library ${name})
    liestat_provide_library(${name} ${liestat_library})
  elseif("${name}" STREQUAL "gtest")
    liestat_provide_package(gtest GTest GTest::gtest_main)
  elseif("${name}" STREQUAL "gmock")
    # A package of its own on Debian; Ceres' matchers for manifolds are written with it.
    liestat_provide_package(gmock GTest GTest::gmock)
  elseif("${name}" STREQUAL "rapidcheck")
    liestat_provide_package(rapidcheck rapidcheck rapidcheck)
  elseif("${name}" STREQUAL "benchmark")
    liestat_provide_package(benchmark benchmark benchmark::benchmark_main)
  elseif("${name}" STREQUAL "opencv")
    # Debian has its CMake package in libopencv-dev alone, with all of the library.
    find_path(LIESTAT_opencv_INCLUDE_DIR ${LIESTAT_HEADER_opencv} PATH_SUFFIXES opencv4)
    find_library(LIESTAT_opencv_calib3d opencv_calib3d)
    find_library(LIESTAT_opencv_core opencv_core)
    mark_as_advanced(LIESTAT_opencv_INCLUDE_DIR LIESTAT_opencv_calib3d LIESTAT_opencv_core)
    if(LIESTAT_opencv_INCLUDE_DIR AND LIESTAT_opencv_calib3d AND LIESTAT_opencv_core)
      liestat_provide(opencv ${LIESTAT_opencv_calib3d} ${LIESTAT_opencv_core})
      target_include_directories(liestat_opencv SYSTEM INTERFACE ${LIESTAT_opencv_INCLUDE_DIR})
    endif()
  elseif("${name}" MATCHES "^(kdl|tf2)$")
    # Without the message packages that their CMake files would have.
    string(REPLACE kdl orocos-kdl liestat_library ${name})
    liestat_provide_library(${name} ${liestat_library})
  elseif("${name}" STREQUAL "mrpt")
    liestat_provide_package(mrpt mrpt-poses mrpt::poses)
  else()
    message(FATAL_ERROR "nobody said how to find ${name}")
  endif()
  set(CMAKE_MESSAGE_LOG_LEVEL ${liestat_log_level})
endmacro()

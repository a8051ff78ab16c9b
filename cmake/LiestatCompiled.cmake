# The estimators as libraries, compiled once by whoever builds them, with the flags of that build: this project, a project
# that adds its directory, or one that finds the installed package. A unit that links one reads declarations only.
#
#   means          Fréchet, Mahalanobis and certified means of the common features in double; states that merge
#   estimation     the cores of constrained estimation and of the implicit filter
#   laws           laws of directions and rotations, comparisons of groups (Random123)
#   fusion         the estimators of fusion/, but for those of trajectories (Random123)
#   trajectories   evaluation and conversion of trajectories, diagnosis of conventions, inertial windows against a truth
#                  (Boost.Math, Random123)
#   formats        readers and writers of files (Boost.Math, {fmt}, zlib, yaml-cpp, nlohmann/json; bags of ROS also use bzip2,
#                  lz4, zstd, SQLite)

set(LIESTAT_COMPILED_PARTS means estimation laws fusion trajectories formats)

set(LIESTAT_COMPILED_SOURCES_means
    mean maha crystal_mean certified_mean certified_maha certified_group_mean robust_mean state state_finish)
set(LIESTAT_COMPILED_SOURCES_estimation constrained implicit_ekf fits)
set(LIESTAT_COMPILED_SOURCES_laws directional_laws compare_groups)
set(LIESTAT_COMPILED_SOURCES_fusion
    initialisation initialisation_truth recording noise_calibration homography_models epipolar_models pose_models
    robust_two_view two_view hand_eye motion patch tracker planar_pose target_pose)
set(LIESTAT_COMPILED_SOURCES_trajectories
    trajectories evaluate trajectory_misfit convention_diagnosis trajectory_conversion recording_windows)
set(LIESTAT_COMPILED_NEEDS_laws random123)
set(LIESTAT_COMPILED_NEEDS_fusion random123)
set(LIESTAT_COMPILED_NEEDS_trajectories boost random123)
set(LIESTAT_COMPILED_NEEDS_formats boost fmt json yaml zlib)
# Packages that it uses if they are there: a definition LIESTAT_HAS_<NAME> tells its sources.
set(LIESTAT_COMPILED_OPTIONAL_formats bz2 lz4 zstd sqlite_library)
# Parts that a part links.
set(LIESTAT_COMPILED_USES_fusion estimation)

# Sets <out> to the packages that a part lacks, in words.
function(liestat_lacking out part)
  set(lacking)
  foreach(need IN LISTS LIESTAT_COMPILED_NEEDS_${part})
    if(NOT TARGET liestat_${need})
      list(APPEND lacking
           "${part} needs ${LIESTAT_HEADER_${need}} (Debian and Ubuntu: ${LIESTAT_PACKAGE_${need}})")
    endif()
  endforeach()
  set(${out} ${lacking} PARENT_SCOPE)
endfunction()

# liestat_compiled(PART ROOT LIBRARY): the static library liestat_PART of the sources below ROOT, known as liestat::PART, too.
# LIBRARY is the target of the headers. There is none if a package is missing that the part needs.
function(liestat_compiled part root library)
  set(target liestat_${part})
  if(TARGET ${target})
    return()
  endif()
  foreach(need IN LISTS LIESTAT_COMPILED_NEEDS_${part})
    if(NOT TARGET liestat_${need})
      return()
    endif()
  endforeach()
  foreach(use IN LISTS LIESTAT_COMPILED_USES_${part})
    liestat_compiled(${use} ${root} ${library})
  endforeach()
  set(directory fusion/compiled)
  if(part MATCHES "^(means|estimation|laws)$")
    set(directory stats/compiled)
  endif()
  # With it the headers know that their definitions are linked (stats/detail/compiled.hpp, fusion/detail/compiled.hpp,
  # stats/detail/compiled_mean.hpp).
  string(TOUPPER LIESTAT_COMPILED_${part} definition)
  if(part STREQUAL "formats")
    # All there are: a format is a source, and no list names it.
    file(GLOB sources CONFIGURE_DEPENDS ${root}/formats/*.cpp ${root}/formats/detail/*.cpp)
  else()
    list(TRANSFORM LIESTAT_COMPILED_SOURCES_${part} PREPEND ${root}/${directory}/ OUTPUT_VARIABLE sources)
    list(TRANSFORM sources APPEND .cpp)
  endif()
  set(packages ${LIESTAT_COMPILED_NEEDS_${part}} ${LIESTAT_COMPILED_USES_${part}})
  list(TRANSFORM packages PREPEND liestat_)
  add_library(${target} STATIC EXCLUDE_FROM_ALL ${sources})
  if(part STREQUAL "formats")
    # Most of what its units cost is the headers that they share. Those of trajectories have names of their own.
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
    foreach(source IN LISTS sources)
      if(source MATCHES "/(pose_graph|trajectory[a-z_]*)[.]cpp$")
        set_source_files_properties(${source} PROPERTIES UNITY_GROUP trajectories)
      else()
        set_source_files_properties(${source} PROPERTIES UNITY_GROUP features)
      endif()
    endforeach()
  endif()
  if(part STREQUAL "means")
    # States have the same bytes on any processor: no product and sum of theirs becomes one fused operation. Rounding to
    # an integer is an instruction where it need not set errno.
    set_source_files_properties(${root}/stats/compiled/state.cpp PROPERTIES COMPILE_OPTIONS "-ffp-contract=off;-fno-math-errno")
  endif()
  if(part STREQUAL "estimation")
    # Loops whose lengths are run-time numbers, which g++ turns into vector instructions at -O3 alone. Those of the filter
    # have a few steps: vector instructions, and calls that copy or clear memory in their place, take a fifth longer.
    set_source_files_properties(${sources} PROPERTIES COMPILE_OPTIONS $<$<CONFIG:Release,RelWithDebInfo>:-O3>)
    set(as_they_stand "$<$<CXX_COMPILER_ID:GNU>:-fno-tree-loop-vectorize;-fno-tree-loop-distribute-patterns>")
    set_source_files_properties(${root}/stats/compiled/implicit_ekf.cpp
                                PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release,RelWithDebInfo>:-O3;${as_they_stand}>")
  endif()
  add_library(liestat::${part} ALIAS ${target})
  if(part STREQUAL "formats")
    # No header of formats/ includes them.
    target_link_libraries(${target} PUBLIC ${library} PRIVATE ${packages} ${CMAKE_DL_LIBS})
    foreach(name IN LISTS LIESTAT_COMPILED_OPTIONAL_${part})
      if(TARGET liestat_${name})
        string(TOUPPER LIESTAT_HAS_${name} has)
        target_link_libraries(${target} PRIVATE liestat_${name})
        target_compile_definitions(${target} PRIVATE ${has})
      endif()
    endforeach()
  else()
    target_link_libraries(${target} PUBLIC ${library} ${packages})
  endif()
  target_compile_definitions(${target} PUBLIC ${definition})
  # Shared libraries, such as modules of Python, link them as well.
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
endfunction()

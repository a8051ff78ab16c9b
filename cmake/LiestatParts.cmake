# The program and the experiments behind it are libraries by subject, so that ./run validate SUBJECT builds what it runs
# and no more. A subject's sources are one translation unit each library, for most of what they cost a compiler is the
# headers that they share; those listed as HEAVY hold templates of the estimators and are compiled by themselves.

# liestat_part(TARGET SOURCES patterns… [HEAVY sources…] [USES targets…])
# All at -O2, the level of the precompiled header: g++ 14 leaves one of another level aside.
function(liestat_part target)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "" "SOURCES;HEAVY;USES")
  file(GLOB sources CONFIGURE_DEPENDS ${ARG_SOURCES})
  set(heavy)
  foreach(source IN LISTS ARG_HEAVY)
    list(APPEND heavy ${CMAKE_CURRENT_SOURCE_DIR}/${source})
  endforeach()
  list(REMOVE_ITEM sources ${heavy})
  add_library(${target} STATIC ${sources} ${heavy})
  target_link_libraries(${target} PUBLIC ${ARG_USES} PRIVATE liestat_strict)
  # Whoever asks for a mean uses liestat_means; all others need its types only.
  target_compile_definitions(${target} PRIVATE LIESTAT_COMPILED_MEANS)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O2>)
  set_source_files_properties(${heavy} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  target_precompile_headers(${target} REUSE_FROM liestat_precompiled)
  set_property(DIRECTORY APPEND PROPERTY LIESTAT_PART_SOURCES ${sources} ${heavy})
  set_property(DIRECTORY APPEND PROPERTY LIESTAT_PARTS ${target})
endfunction()

# liestat_all_parts(TARGET): the parts of this directory together. A source that belongs to none or to two of them ends
# the configuration.
function(liestat_all_parts target)
  get_property(parts DIRECTORY PROPERTY LIESTAT_PARTS)
  get_property(listed DIRECTORY PROPERTY LIESTAT_PART_SOURCES)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  list(REMOVE_ITEM sources ${CMAKE_CURRENT_SOURCE_DIR}/main.cpp)
  foreach(source IN LISTS listed)
    if(NOT source IN_LIST sources)
      message(FATAL_ERROR "${source} is listed in two parts, or does not exist")
    endif()
    list(REMOVE_ITEM sources ${source})
  endforeach()
  if(sources)
    message(FATAL_ERROR "In no part of ${CMAKE_CURRENT_SOURCE_DIR}/CMakeLists.txt: ${sources}")
  endif()
  add_library(${target} INTERFACE)
  target_link_libraries(${target} INTERFACE ${parts})
endfunction()

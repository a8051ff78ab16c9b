# Finds every optional package once. Each becomes an INTERFACE target liestat_<name> that exists only when the package
# does; whoever needs it says so with NEEDS <name> and is left out, and named in the summary, when it is absent.

include(LiestatPackages)

# LIESTAT_WITH_<NAME>=OFF pretends that a package is not installed: so the Eigen-only configuration is tested on a
# machine that has them all.
set(liestat_wanted)
foreach(name IN LISTS LIESTAT_DEPENDENCIES)
  string(TOUPPER ${name} upper)
  option(LIESTAT_WITH_${upper} "Use ${LIESTAT_PACKAGE_${name}} when it is installed" ON)
  if(LIESTAT_WITH_${upper})
    list(APPEND liestat_wanted ${name})
  endif()
endforeach()

# A package that is half there (its compiler wrapper without its headers, its CMake files without its library) ends the
# configuration or the build with an error that nothing can catch. Each is therefore found and used in a small project
# of its own first, cmake/probe, in another process: all of them at once, which takes about a second, and one by one
# only when that fails.
function(liestat_probe out directory)
  # The same cache leads to the same findings.
  set(cache)
  get_cmake_property(variables CACHE_VARIABLES)
  foreach(variable IN LISTS variables)
    get_property(type CACHE ${variable} PROPERTY TYPE)
    if(NOT type STREQUAL "INTERNAL" AND NOT type STREQUAL "STATIC")
      string(APPEND cache "set(${variable} [==[${${variable}}]==] CACHE ${type} \"\")\n")
    endif()
  endforeach()
  file(REMOVE_RECURSE ${directory})
  file(WRITE ${directory}/cache.cmake "${cache}set(LIESTAT_PROBED [==[${ARGN}]==] CACHE STRING \"\")\n")
  execute_process(COMMAND ${CMAKE_COMMAND} -G ${CMAKE_GENERATOR} -C ${directory}/cache.cmake
                          -S ${PROJECT_SOURCE_DIR}/cmake/probe -B ${directory}
                  RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT failed)
    execute_process(COMMAND ${CMAKE_COMMAND} --build ${directory} RESULT_VARIABLE failed OUTPUT_VARIABLE output
                    ERROR_VARIABLE output)
  endif()
  file(WRITE ${directory}/log.txt "${output}")
  if(failed)
    set(${out} FALSE PARENT_SCOPE)
  else()
    set(${out} TRUE PARENT_SCOPE)
  endif()
endfunction()

liestat_probe(liestat_whole ${PROJECT_BINARY_DIR}/probe/all ${liestat_wanted})
foreach(name IN LISTS liestat_wanted)
  if(NOT liestat_whole)
    liestat_probe(LIESTAT_USABLE_${name} ${PROJECT_BINARY_DIR}/probe/${name} ${name})
    if(NOT LIESTAT_USABLE_${name})
      continue()
    endif()
  endif()
  liestat_find(${name})
endforeach()

# Sets <out> to those of the needs that are absent, and <out>_libraries to the targets of the others.
function(liestat_missing out)
  set(missing)
  set(libraries)
  foreach(need IN LISTS ARGN)
    if(TARGET liestat_${need})
      list(APPEND libraries liestat_${need})
    elseif(NOT need IN_LIST LIESTAT_DEPENDENCIES)
      message(FATAL_ERROR "NEEDS ${need}: not one of ${LIESTAT_DEPENDENCIES}")
    else()
      list(APPEND missing ${need})
    endif()
  endforeach()
  set(${out} ${missing} PARENT_SCOPE)
  set(${out}_libraries ${libraries} PARENT_SCOPE)
endfunction()

# Remembers that <what> was left out for want of the packages in ARGN; liestat_summary prints it.
function(liestat_switched_off what)
  foreach(need IN LISTS ARGN)
    set_property(GLOBAL APPEND PROPERTY LIESTAT_OFF_${need} "${what}")
  endforeach()
endfunction()

function(liestat_summary)
  set(first TRUE)
  foreach(name IN LISTS LIESTAT_DEPENDENCIES)
    if(TARGET liestat_${name})
      continue()
    endif()
    get_property(without GLOBAL PROPERTY LIESTAT_OFF_${name})
    list(REMOVE_DUPLICATES without)
    list(JOIN without ", " without)
    if(without STREQUAL "")
      continue()
    endif()
    if(first)
      message(STATUS "Switched off, with the Debian package that would switch it on:")
      set(first FALSE)
    endif()
    string(TOUPPER ${name} upper)
    if(DEFINED LIESTAT_USABLE_${name} AND NOT LIESTAT_USABLE_${name})
      message(STATUS "  ${LIESTAT_PACKAGE_${name}} (only a part of it is installed, see "
                     "${PROJECT_BINARY_DIR}/probe/${name}/log.txt): ${without}")
    elseif(LIESTAT_WITH_${upper})
      message(STATUS "  ${LIESTAT_PACKAGE_${name}}: ${without}")
    else()
      message(STATUS "  ${LIESTAT_PACKAGE_${name}} (LIESTAT_WITH_${upper} is OFF): ${without}")
    endif()
  endforeach()
endfunction()

# What the experiments cannot do without; their tests share the list.
set(LIESTAT_EXPERIMENTS_NEEDS boost random123 fmt json yaml zlib)
# What the program cannot do without; its tests share the list.
set(LIESTAT_CLI_NEEDS boost random123 cli11 fmt json yaml zlib)

# The compiler of the tests. clang++ with its precompiled header takes less than half of g++'s time for them, so where g++
# compiles the program and the libraries clang++ compiles the tests, which link these: the program and the libraries stay
# what a user gets. LIESTAT_TEST_COMPILER=g++, in the environment of ./run or of cmake --preset, leaves all to g++.
set(LIESTAT_TEST_COMPILER "" CACHE STRING "Compiler of the tests; empty: clang++ if it is there and g++ compiles the rest")

set(liestat_test_launcher)
set(liestat_test_options)
set(liestat_clang_compiles_tests FALSE)
if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  set(liestat_clang_compiles_tests TRUE)
endif()
set(liestat_test_compiler "${LIESTAT_TEST_COMPILER}")
if(NOT liestat_test_compiler AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_CROSSCOMPILING)
  set(liestat_test_compiler clang++)
endif()
if(liestat_test_compiler)
  find_program(liestat_test_compiler_path ${liestat_test_compiler} NO_CACHE)
  get_filename_component(own ${CMAKE_CXX_COMPILER} NAME)
  if(NOT liestat_test_compiler_path)
    set(liestat_no_compiler "there is no ${liestat_test_compiler}")
  elseif(NOT liestat_test_compiler STREQUAL own AND NOT liestat_test_compiler_path STREQUAL CMAKE_CXX_COMPILER)
    set(liestat_test_launcher ${CMAKE_CURRENT_SOURCE_DIR}/compile_with.sh ${CMAKE_CXX_COMPILER_LAUNCHER}
                              ${liestat_test_compiler_path} --)
    # The other options are those of the project's compiler.
    set(liestat_test_options -Wno-unknown-warning-option -Wno-gnu-zero-variadic-macro-arguments)
    execute_process(COMMAND ${liestat_test_compiler_path} --version OUTPUT_VARIABLE version ERROR_QUIET)
    if(version MATCHES "clang version ([0-9]+)")
      # More than half of its time for a test at -O1 is optimisation.
      set(liestat_clang_compiles_tests TRUE)
      list(APPEND liestat_test_options -fpch-instantiate-templates)
      # Later versions write the constraints of a template into its name, and g++ 14 does not write the same.
      if(CMAKE_MATCH_1 GREATER 16)
        list(APPEND liestat_test_options -fclang-abi-compat=16)
      endif()
    endif()
    # Asked once for each pair of compilers and their flags.
    string(TOUPPER "CMAKE_CXX_FLAGS_${CMAKE_BUILD_TYPE}" flags)
    string(SHA1 pair "${version};${CMAKE_CXX_COMPILER};${CMAKE_CXX_COMPILER_VERSION};${CMAKE_CXX_FLAGS};${${flags}}")
    string(SUBSTRING ${pair} 0 8 pair)
    get_target_property(eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
    try_compile(
      LIESTAT_TWO_COMPILERS_${pair} ${CMAKE_CURRENT_BINARY_DIR}/two_compilers
      ${CMAKE_CURRENT_SOURCE_DIR}/configure/two_compilers two_compilers
      CMAKE_FLAGS "-DCMAKE_BUILD_TYPE=${CMAKE_BUILD_TYPE}" "-DCMAKE_CXX_FLAGS=${CMAKE_CXX_FLAGS} ${${flags}}"
                  "-DEIGEN=${eigen}" "-DLAUNCHER=${liestat_test_launcher}" "-DOPTIONS=${liestat_test_options}"
      OUTPUT_VARIABLE output)
    if(NOT LIESTAT_TWO_COMPILERS_${pair})
      set(liestat_no_compiler "its objects and those of ${own} do not work together")
      file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/two_compilers.log "${output}")
    endif()
  endif()
  if(liestat_no_compiler AND LIESTAT_TEST_COMPILER)
    message(FATAL_ERROR "LIESTAT_TEST_COMPILER=${LIESTAT_TEST_COMPILER}: ${liestat_no_compiler}")
  elseif(liestat_no_compiler)
    message(STATUS "Tests are compiled by ${own}, not ${liestat_test_compiler}: ${liestat_no_compiler}")
    set(liestat_test_launcher)
    set(liestat_test_options)
    set(liestat_clang_compiles_tests FALSE)
  elseif(liestat_test_launcher)
    message(STATUS "Tests are compiled by ${liestat_test_compiler_path}")
  endif()
endif()

# liestat_compile_as_test(TARGET): with that compiler.
function(liestat_compile_as_test target)
  if(liestat_test_launcher)
    set_target_properties(${target} PROPERTIES CXX_COMPILER_LAUNCHER "${liestat_test_launcher}")
    target_compile_options(${target} PRIVATE ${liestat_test_options})
  endif()
endfunction()

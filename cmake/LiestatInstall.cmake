# Installs the headers as <prefix>/include/liestat/<room>/…, a CMake package and a pkg-config file, and the program where it
# was built (its component is program; the rest works without it). Nothing in the package files depends on the
# architecture, so they live under share/ and the installed tree may be moved.
include(CMakePackageConfigHelpers)

foreach(room lie stats fusion)
  install(DIRECTORY ${room} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/liestat FILES_MATCHING PATTERN "*.hpp"
          PATTERN "*.h" PATTERN "compiled/*.cpp")
endforeach()
install(DIRECTORY formats DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/liestat FILES_MATCHING PATTERN "*.hpp" PATTERN "*.cpp")
install(FILES report/describe.hpp DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/liestat/report)

set(liestat_package_dir ${CMAKE_INSTALL_DATADIR}/cmake/liestat)
install(TARGETS liestat EXPORT liestatTargets)
install(EXPORT liestatTargets NAMESPACE liestat:: DESTINATION ${liestat_package_dir})
configure_package_config_file(cmake/liestatConfig.cmake.in ${PROJECT_BINARY_DIR}/liestatConfig.cmake
                              INSTALL_DESTINATION ${liestat_package_dir} PATH_VARS CMAKE_INSTALL_INCLUDEDIR)
# Before 1.0 a minor version may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/liestatConfigVersion.cmake COMPATIBILITY SameMinorVersion
                                 ARCH_INDEPENDENT)
install(FILES ${PROJECT_BINARY_DIR}/liestatConfig.cmake ${PROJECT_BINARY_DIR}/liestatConfigVersion.cmake
              cmake/LiestatPackages.cmake cmake/LiestatCompiled.cmake
        DESTINATION ${liestat_package_dir})

# The prefix is written relative to the file's own directory, so that the tree may be moved.
set(liestat_pc_dir ${CMAKE_INSTALL_DATADIR}/pkgconfig)
if(IS_ABSOLUTE "${CMAKE_INSTALL_INCLUDEDIR}" OR IS_ABSOLUTE "${CMAKE_INSTALL_DATADIR}")
  set(LIESTAT_PC_PREFIX ${CMAKE_INSTALL_PREFIX})
  set(LIESTAT_PC_INCLUDEDIR ${CMAKE_INSTALL_FULL_INCLUDEDIR})
else()
  file(RELATIVE_PATH liestat_pc_up /${liestat_pc_dir} /)
  string(REGEX REPLACE "/$" "" liestat_pc_up "${liestat_pc_up}")
  set(LIESTAT_PC_PREFIX "\${pcfiledir}/${liestat_pc_up}")
  set(LIESTAT_PC_INCLUDEDIR "\${prefix}/${CMAKE_INSTALL_INCLUDEDIR}")
endif()
configure_file(cmake/liestat.pc.in ${PROJECT_BINARY_DIR}/liestat.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/liestat.pc DESTINATION ${liestat_pc_dir})

install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
if(TARGET liestat_program)
  install(TARGETS liestat_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program OPTIONAL)
  if(TARGET liestat_opencv_module)
    # The program looks for it there, relative to its own place.
    install(TARGETS liestat_opencv_module LIBRARY DESTINATION lib/liestat COMPONENT program OPTIONAL)
  endif()
  install(FILES ${PROJECT_BINARY_DIR}/liestat.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program OPTIONAL)
  install(FILES ${PROJECT_BINARY_DIR}/liestat.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
          RENAME liestat COMPONENT program OPTIONAL)
endif()

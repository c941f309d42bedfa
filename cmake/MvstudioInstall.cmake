# cmake --install: programs, libraries, headers, and a package for find_package(mvstudio).
include(CMakePackageConfigHelpers)
set(MVSTUDIO_PACKAGE lib/cmake/mvstudio)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME dev)

function(mvstudio_install)
  mvstudio_modules(modules)
  list(REMOVE_ITEM modules cli python)
  if(MVSTUDIO_AVATAR)
    list(FILTER modules EXCLUDE REGEX "/")  # their folders hold them
  endif()
  install(CODE "set(MVSTUDIO_SOURCE \"${CMAKE_SOURCE_DIR}\")\nset(MVSTUDIO_MODULES \"${modules}\")")
  install(SCRIPT ${CMAKE_SOURCE_DIR}/cmake/InstallHeaders.cmake)
  install(TARGETS mvstudio_warnings EXPORT mvstudio-targets)
  install(EXPORT mvstudio-targets NAMESPACE mvstudio:: DESTINATION ${MVSTUDIO_PACKAGE})
  if(MVSTUDIO_AVATAR)
    install(EXPORT mvstudio-avatar-targets NAMESPACE mvstudio:: DESTINATION ${MVSTUDIO_PACKAGE})
  endif()
  configure_package_config_file(${CMAKE_SOURCE_DIR}/cmake/mvstudio-config.cmake.in ${CMAKE_BINARY_DIR}/mvstudio-config.cmake
    INSTALL_DESTINATION ${MVSTUDIO_PACKAGE})
  write_basic_package_version_file(${CMAKE_BINARY_DIR}/mvstudio-config-version.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${CMAKE_BINARY_DIR}/mvstudio-config.cmake ${CMAKE_BINARY_DIR}/mvstudio-config-version.cmake
    ${CMAKE_SOURCE_DIR}/cmake/FindMrcal.cmake DESTINATION ${MVSTUDIO_PACKAGE})
endfunction()

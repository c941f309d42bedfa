# Compiler launcher, warnings, sanitizers, and mvstudio_add_module().

find_program(MVSTUDIO_CCACHE ccache)
if(MVSTUDIO_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # The sloppiness is what ccache asks for to cache files that use a precompiled header.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${MVSTUDIO_CCACHE})
endif()

find_program(MVSTUDIO_MOLD mold)
if(MVSTUDIO_MOLD)
  add_link_options(-fuse-ld=mold)
endif()

add_library(mvstudio_warnings INTERFACE)
target_compile_options(mvstudio_warnings INTERFACE -Wall -Wextra -Wshadow=local -Wnon-virtual-dtor -Woverloaded-virtual)
if(MVSTUDIO_WERROR)
  target_compile_options(mvstudio_warnings INTERFACE -Werror)
endif()

if(MVSTUDIO_SANITIZE)
  add_compile_options(-fsanitize=${MVSTUDIO_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=undefined)
  add_link_options(-fsanitize=${MVSTUDIO_SANITIZE})
endif()

# What is precompiled: parsing these headers is most of what a file costs otherwise (docs/notes/build-time.md).
set(MVSTUDIO_PCH_STD ${CMAKE_SOURCE_DIR}/cmake/pch_std.h)
set(MVSTUDIO_PCH_EIGEN ${CMAKE_SOURCE_DIR}/cmake/pch_eigen.h)
set(MVSTUDIO_PCH_TORCH ${CMAKE_SOURCE_DIR}/cmake/pch_torch.h)

# mvstudio_add_module(NAME [HEADER…]): library mvstudio_NAME (alias mvstudio::NAME) from every .cc file of the current folder, HEADERs
# precompiled.
# Dependencies are given with target_link_libraries: PUBLIC for what the module's headers include, PRIVATE for the rest.
function(mvstudio_add_module name)
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cc)
  add_library(mvstudio_${name} STATIC ${sources})
  add_library(mvstudio::${name} ALIAS mvstudio_${name})
  target_include_directories(mvstudio_${name} PUBLIC ${CMAKE_SOURCE_DIR})
  target_link_libraries(mvstudio_${name} PRIVATE mvstudio_warnings)
  if(NOT ARGN STREQUAL "")
    target_precompile_headers(mvstudio_${name} PRIVATE ${ARGN})
  endif()
endfunction()

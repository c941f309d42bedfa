# Compiler launcher, warnings, sanitizers, and mvstudio_add_module().

# Whole builds compile groups of files at once and do without ccache, whose misses cost a fifth; builds that are changed and built again
# (preset dev) compile file by file (docs/notes/build-time.md).
find_program(MVSTUDIO_CCACHE ccache)
if(MVSTUDIO_CCACHE AND NOT MVSTUDIO_UNITY AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${MVSTUDIO_CCACHE})
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

# Enums have words in JSON. The library would write their numbers where nobody gives it the word.
add_compile_definitions(JSON_DISABLE_ENUM_SERIALIZATION=1)

if(MVSTUDIO_SANITIZE)
  add_compile_options(-fsanitize=${MVSTUDIO_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=undefined)
  add_link_options(-fsanitize=${MVSTUDIO_SANITIZE})
  # Eigen would align by hand what it allocates, and OpenGV, which was built without sanitizers, would free it otherwise.
  add_compile_definitions(EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()

if(MVSTUDIO_UNITY OR MVSTUDIO_TESTS)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
endif()

# mvstudio_modules(NAME): sets NAME to the modules of cmake/modules.txt that this build has, from the ground up.
function(mvstudio_modules name)
  file(STRINGS ${CMAKE_SOURCE_DIR}/cmake/modules.txt modules REGEX "^[a-z]")
  set_property(DIRECTORY ${CMAKE_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/cmake/modules.txt)
  if(NOT MVSTUDIO_AVATAR)
    list(FILTER modules EXCLUDE REGEX " torch$")
  endif()
  if(NOT MVSTUDIO_PYTHON)
    list(REMOVE_ITEM modules python)
  endif()
  list(TRANSFORM modules REPLACE " torch$" "")
  set(${name} ${modules} PARENT_SCOPE)
endfunction()

# mvstudio_group_sources(TARGET): compiles up to 24 source files of the target as one, where they share no name at file scope.
# A quarter less to compile than with 8 (docs/notes/build-time.md); a compiler takes up to 2 GB.
function(mvstudio_group_sources target)
  if(NOT MVSTUDIO_UNITY)
    return()
  endif()
  get_target_property(sources ${target} SOURCES)
  execute_process(COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/cmake/unity_groups.py 24 ${sources}
    WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} OUTPUT_VARIABLE groups COMMAND_ERROR_IS_FATAL ANY)
  string(REPLACE "\n" ";" groups "${groups}")
  foreach(line ${groups})
    string(REGEX MATCH "^(g[0-9]+) (.+)$" line "${line}")
    set_source_files_properties(${CMAKE_MATCH_2} PROPERTIES UNITY_GROUP ${CMAKE_MATCH_1})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  target_compile_options(${target} PRIVATE -Wno-subobject-linkage)  # GCC takes an included .cc file for a header
endfunction()

# mvstudio_add_module(NAME [FOLDER...]): library mvstudio_NAME (alias mvstudio::NAME) from every .cc file of the current folder and of
# the folders named. Dependencies are given with target_link_libraries: PUBLIC for what the module's headers include, PRIVATE for the rest.
function(mvstudio_add_module name)
  set(patterns ${CMAKE_CURRENT_SOURCE_DIR}/*.cc)
  foreach(folder ${ARGN})
    list(APPEND patterns ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cc)
  endforeach()
  file(GLOB sources CONFIGURE_DEPENDS ${patterns})
  add_library(mvstudio_${name} STATIC ${sources})
  add_library(mvstudio::${name} ALIAS mvstudio_${name})
  target_include_directories(mvstudio_${name} PUBLIC $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}> $<INSTALL_INTERFACE:include/mvstudio>)
  target_link_libraries(mvstudio_${name} PRIVATE mvstudio_warnings)
  target_compile_features(mvstudio_${name} PUBLIC cxx_std_17)
  set_target_properties(mvstudio_${name} PROPERTIES EXPORT_NAME ${name})
  if(name MATCHES "^(avatar|avatar_run|detect|stages_nets)$")
    set(export mvstudio-avatar-targets)  # these need libtorch
  else()
    set(export mvstudio-targets)
    # Python's module is a shared library of these. Nobody replaces symbols of ours, so that calls stay direct.
    set_target_properties(mvstudio_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    target_compile_options(mvstudio_${name} PRIVATE -fno-semantic-interposition)
  endif()
  install(TARGETS mvstudio_${name} EXPORT ${export})
  mvstudio_group_sources(mvstudio_${name})
endfunction()

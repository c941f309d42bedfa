# What the tests of a sanitizer build need: options of its runtime, and more time.
set(MVSTUDIO_TEST_ENVIRONMENT "MVSTUDIO_BIN=${CMAKE_BINARY_DIR}/bin/mvstudio;MVSTUDIO_SOURCE=${CMAKE_SOURCE_DIR};MVSTUDIO_CACHE=off;GOMP_SPINCOUNT=1000")
set(MVSTUDIO_TEST_PATIENCE 1)
if(MVSTUDIO_SANITIZE MATCHES address)
  set(MVSTUDIO_TEST_PATIENCE 15)
  list(APPEND MVSTUDIO_TEST_ENVIRONMENT "LSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/cmake/sanitizers/lsan.txt:print_suppressions=0"
    "UBSAN_OPTIONS=print_stacktrace=1")
elseif(MVSTUDIO_SANITIZE MATCHES thread)
  set(MVSTUDIO_TEST_PATIENCE 15)
  # Packs are checked in a process that is forked while other threads may run.
  list(APPEND MVSTUDIO_TEST_ENVIRONMENT
    "TSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/cmake/sanitizers/tsan.txt:die_after_fork=0:second_deadlock_stack=1")
endif()

function(mvstudio_test_target target)
  # A third less to compile with -O1, and half with -O0 where tests do not compute much by themselves; what is tested keeps its flags.
  if(target MATCHES "^test_(cli|stages|dataset|report|exports|trackers|markers|pack|detect|avatar)$")
    set(level -O0)
  else()
    set(level -O1)
  endif()
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:${level}>)
  target_link_libraries(${target} PRIVATE ${ARGN} mvstudio_test_support mvstudio_test_main GTest::gmock mvstudio_warnings)
endfunction()

# mvstudio_add_tests(MODULE DEPS...): program test_MODULE from every MODULE/*_test.cc of the current folder, and one ctest entry
# MODULE/UNIT for each of them, which runs the tests of that file alone.
# A file ending in _slow_test.cc gets the label `slow`, _integration_test.cc `integration`, any other `unit`.
function(mvstudio_add_tests module)
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${module}/*_test.cc)
  if(NOT MVSTUDIO_AVATAR)
    list(FILTER sources EXCLUDE REGEX "/cli/(avatar|demo|mask|run_session|metrics|models|pose2d)_[a-z_0-9]*\\.cc$|/stages/nets_[a-z_0-9]*\\.cc$|/digits/sets_test\\.cc$")  # need libtorch
  endif()
  set(target test_${module})
  add_executable(${target} ${sources})
  mvstudio_test_target(${target} ${ARGN})
  mvstudio_group_sources(${target})
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  foreach(source ${sources})
    get_filename_component(unit ${source} NAME_WE)
    string(REGEX REPLACE "_test$" "" unit ${unit})
    set(label unit)
    set(timeout 120)
    if(unit MATCHES "_slow$")
      set(label slow)
      set(timeout 1500)
    elseif(unit MATCHES "_integration$")
      set(label integration)
      set(timeout 300)
    endif()
    math(EXPR timeout "${timeout} * ${MVSTUDIO_TEST_PATIENCE}")
    add_test(NAME ${module}/${unit} COMMAND ${target} --file=${source})
    set_tests_properties(${module}/${unit} PROPERTIES LABELS ${label} TIMEOUT ${timeout} ENVIRONMENT "${MVSTUDIO_TEST_ENVIRONMENT}")
    if(MVSTUDIO_SANITIZE)
      # Also where the process that was ended is a child, and the test expects it to fail.
      set_tests_properties(${module}/${unit} PROPERTIES FAIL_REGULAR_EXPRESSION "ERROR: [A-Za-z]+Sanitizer;WARNING: ThreadSanitizer;: runtime error: ")
    endif()
  endforeach()
endfunction()

# mvstudio_plan_tests(FILE): what a run of all tests should know of the long ones. Lines "NAME SECONDS [nightly] [threads] [alone]":
# long tests start first; `nightly` ones are left to `scripts/test nightly`; those with `threads` keep all processors busy and those that
# need the machine `alone` run by themselves.
function(mvstudio_plan_tests file)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(STRINGS ${file} lines REGEX "^[^#]")
  foreach(line ${lines})
    separate_arguments(words UNIX_COMMAND "${line}")
    list(POP_FRONT words name seconds)
    if(NOT TEST ${name})
      continue()  # not in this configuration
    endif()
    set_tests_properties(${name} PROPERTIES COST ${seconds})
    if(nightly IN_LIST words)
      set_property(TEST ${name} APPEND PROPERTY LABELS nightly)
    endif()
    if(threads IN_LIST words)
      set_tests_properties(${name} PROPERTIES PROCESSORS 2)
    endif()
    if(alone IN_LIST words)
      set_tests_properties(${name} PROPERTIES RUN_SERIAL TRUE)
    endif()
  endforeach()
endfunction()

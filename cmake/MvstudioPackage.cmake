# cpack -G DEB: a Debian package of each install component (scripts/package). The default component of install() is dev.
set(MVSTUDIO_DOC ${CMAKE_BINARY_DIR}/package)

# mvstudio_package_texts(PACKAGE COMPONENT): the copyright and changelog that Debian wants of every package.
function(mvstudio_package_texts package component)
  install(FILES ${MVSTUDIO_DOC}/copyright ${MVSTUDIO_DOC}/changelog.gz DESTINATION share/doc/${package} COMPONENT ${component})
  file(WRITE ${MVSTUDIO_DOC}/overrides/${package}
    "# Whoever publishes the packages gives an address: cmake -DMVSTUDIO_CONTACT=…\nbogus-mail-host\nbogus-mail-host-in-debian-changelog\n")
  install(FILES ${MVSTUDIO_DOC}/overrides/${package} DESTINATION share/lintian/overrides COMPONENT ${component})
endfunction()

# mvstudio_package_set(COMPONENT PACKAGE DEPENDS SUMMARY TEXT)
function(mvstudio_package_set component package depends summary text)
  string(TOUPPER ${component} upper)
  set(prefix CPACK_DEBIAN_${upper})
  set(${prefix}_PACKAGE_NAME ${package} PARENT_SCOPE)
  set(${prefix}_PACKAGE_DEPENDS "${depends}" PARENT_SCOPE)
  set(${prefix}_PACKAGE_SECTION science PARENT_SCOPE)
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${summary}\n${text}" PARENT_SCOPE)
  set(${prefix}_DESCRIPTION "${summary}\n${text}" PARENT_SCOPE)
  mvstudio_package_texts(${package} ${component})
endfunction()

macro(mvstudio_package)
  file(MAKE_DIRECTORY ${MVSTUDIO_DOC})
  configure_file(${CMAKE_SOURCE_DIR}/cmake/package/copyright.in ${MVSTUDIO_DOC}/copyright @ONLY)
  set(MVSTUDIO_CONTACT "the mvstudio developers <mvstudio@localhost>" CACHE STRING "maintainer of the packages")
  string(TIMESTAMP packed "%a, %d %b %Y %H:%M:%S +0000" UTC)  # SOURCE_DATE_EPOCH sets it
  configure_file(${CMAKE_SOURCE_DIR}/cmake/package/changelog.in ${MVSTUDIO_DOC}/changelog @ONLY)
  execute_process(COMMAND gzip -9nc ${MVSTUDIO_DOC}/changelog OUTPUT_FILE ${MVSTUDIO_DOC}/changelog.gz COMMAND_ERROR_IS_FATAL ANY)
  find_package(OpenCV 4.6 REQUIRED COMPONENTS core)
  # Loaded with the first image, so that no list of shared libraries names it (core/imgcodecs).
  math(EXPR opencv "${OpenCV_VERSION_MAJOR} * 100 + ${OpenCV_VERSION_MINOR}")
  set(same "mvstudio (= ${PROJECT_VERSION})")

  mvstudio_package_set(program mvstudio "libopencv-imgcodecs${opencv}"
    "multi-view capture: calibrated rigs, 3D joints, datasets"
    "From footage of a calibration board and of people, seen by many fixed cameras:\na rig with its covariance, 3D joints, datasets in CMU Panoptic's layout and a\nreport.")
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "mvstudio-avatar (= ${PROJECT_VERSION})")
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "mvstudio-examples, chromium, ninja-build")
  install(TARGETS mvstudio COMPONENT program)
  install(DIRECTORY ${CMAKE_SOURCE_DIR}/docs/ DESTINATION share/doc/mvstudio/docs COMPONENT program PATTERN notes EXCLUDE)
  install(FILES ${CMAKE_SOURCE_DIR}/README.md ${CMAKE_SOURCE_DIR}/CHANGELOG.md DESTINATION share/doc/mvstudio COMPONENT program)
  install(CODE "
    execute_process(COMMAND \"${CMAKE_SOURCE_DIR}/scripts/manual\" \"${MVSTUDIO_DOC}/manual\" COMMAND_ERROR_IS_FATAL ANY)
    file(GLOB pages \"${MVSTUDIO_DOC}/manual/man/man1/*.1\")
    execute_process(COMMAND gzip -9nf \${pages} COMMAND_ERROR_IS_FATAL ANY)
    file(INSTALL \"${MVSTUDIO_DOC}/manual/man\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/share\" FILES_MATCHING PATTERN *.gz
      PATTERN mvstudio-avatar.1.gz EXCLUDE)
    file(INSTALL \"${MVSTUDIO_DOC}/manual/bash/mvstudio\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/share/bash-completion/completions\")
    file(INSTALL \"${MVSTUDIO_DOC}/manual/zsh/_mvstudio\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/share/zsh/vendor-completions\")
    file(INSTALL \"${MVSTUDIO_DOC}/manual/fish/mvstudio.fish\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/share/fish/vendor_completions.d\")"
    COMPONENT program)

  mvstudio_package_set(dev libmvstudio-dev
    "libeigen3-dev, libopencv-dev, libceres-dev, libsuitesparse-dev, libapriltag-dev, libopengv-dev, libmrcal-dev, libhdf5-dev, libembree-dev, libavcodec-dev, libavformat-dev, libavutil-dev, libswscale-dev, nlohmann-json3-dev, libtomlplusplus-dev, libyaml-cpp-dev, libpugixml-dev, libarchive-dev, libboost-dev"
    "mvstudio's libraries and headers"
    "Static libraries, headers and CMake's package: calibration, triangulation,\ndatasets and every stage of mvstudio as a function.")
  set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
  set(CPACK_DEBIAN_DEV_PACKAGE_SHLIBDEPS OFF)
  set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS libtorch-dev)

  mvstudio_package_set(examples mvstudio-examples "" "small synthetic session for mvstudio"
    "Footage of four cameras, a board and a walking person, with the exact rig and\njoints beside it.")
  set(CPACK_DEBIAN_EXAMPLES_PACKAGE_ARCHITECTURE all)
  set(CPACK_DEBIAN_EXAMPLES_PACKAGE_SHLIBDEPS OFF)
  install(CODE "
    execute_process(COMMAND \"${CMAKE_BINARY_DIR}/bin/mvstudio\" synth --cameras 4 --size 480x360 --board-frames 20 --take-frames 50 --quiet
      --overwrite --out \"${MVSTUDIO_DOC}/studio\" OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
    file(INSTALL \"${MVSTUDIO_DOC}/studio\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/share/doc/mvstudio/examples\" PATTERN .mvstudio* EXCLUDE
      PATTERN *.result.json EXCLUDE PATTERN provenance.jsonl EXCLUDE)" COMPONENT examples EXCLUDE_FROM_ALL)

  set(CPACK_COMPONENTS_ALL program dev examples)
  if(MVSTUDIO_AVATAR)
    mvstudio_package_set(avatar mvstudio-avatar "${same}" "avatars, keypoint nets and masks of mvstudio"
      "The commands that need libtorch: neural and Gaussian avatars, 2D keypoints,\nmasks, metrics.")
    install(TARGETS mvstudio-avatar COMPONENT avatar)
    install(CODE "
      execute_process(COMMAND \"${CMAKE_SOURCE_DIR}/scripts/manual\" \"${MVSTUDIO_DOC}/manual-avatar\" COMMAND_ERROR_IS_FATAL ANY)
      execute_process(COMMAND gzip -9nf \"${MVSTUDIO_DOC}/manual-avatar/man/man1/mvstudio-avatar.1\" COMMAND_ERROR_IS_FATAL ANY)
      file(INSTALL \"${MVSTUDIO_DOC}/manual-avatar/man/man1/mvstudio-avatar.1.gz\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/share/man/man1\")"
      COMPONENT avatar)
    list(APPEND CPACK_COMPONENTS_ALL avatar)
  endif()

  if(TARGET mvstudio_python)
    mvstudio_package_set(python python3-mvstudio "python3, python3-numpy, libopencv-imgcodecs${opencv}" "mvstudio from Python"
      "Rigs, triangulation and scores on NumPy's arrays, and the stages of mvstudio as\nfunctions.")
    set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
    set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "python3-matplotlib")
    set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-pandas, python3-torch")
    install(TARGETS mvstudio_python DESTINATION lib/python3/dist-packages/mvstudio COMPONENT python)
    install(DIRECTORY ${CMAKE_BINARY_DIR}/python/mvstudio DESTINATION lib/python3/dist-packages COMPONENT python
      PATTERN __pycache__ EXCLUDE PATTERN *.so EXCLUDE)
    list(APPEND CPACK_COMPONENTS_ALL python)
  endif()

  set(CPACK_GENERATOR DEB)
  set(CPACK_DEB_COMPONENT_INSTALL ON)
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_COMPRESSION_TYPE gzip)  # xz takes minutes for the archives of libmvstudio-dev
  set(CPACK_STRIP_FILES ON)
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_PACKAGE_CONTACT "${MVSTUDIO_CONTACT}")
  set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
  include(CPack)
endmacro()

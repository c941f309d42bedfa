# Run when building: bundles MAIN with three.js (folder THREE) by ESBUILD, and writes OUT, the source of ViewerScript().
set(work ${OUT}.work)
file(MAKE_DIRECTORY ${work}/node_modules)
file(CREATE_LINK ${THREE} ${work}/node_modules/three SYMBOLIC)
execute_process(COMMAND ${CMAKE_COMMAND} -E env NODE_PATH=${work}/node_modules ${ESBUILD} ${MAIN} --bundle --minify --format=iife
    --target=es2019 --charset=ascii --legal-comments=none --log-level=warning --outfile=${work}/bundle.js
  RESULT_VARIABLE code)
if(NOT code EQUAL 0)
  message(FATAL_ERROR "esbuild could not bundle ${MAIN}")
endif()
file(READ ${work}/bundle.js script)
# The end of a raw string, and what would end or change a <script> of HTML.
foreach(forbidden ")viewer\"" "</script" "<!--")
  string(FIND "${script}" "${forbidden}" at)
  if(NOT at EQUAL -1)
    message(FATAL_ERROR "the bundle of ${MAIN} contains ${forbidden}")
  endif()
endforeach()
set(licence "/* three.js r111, https://threejs.org, Copyright 2010-2019 three.js authors, MIT licence:
Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated documentation
files (the \"Software\"), to deal in the Software without restriction, including without limitation the rights to use, copy,
modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the
Software is furnished to do so, subject to the following conditions: The above copyright notice and this permission notice
shall be included in all copies or substantial portions of the Software. THE SOFTWARE IS PROVIDED \"AS IS\", WITHOUT WARRANTY
OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR
PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR
THE USE OR OTHER DEALINGS IN THE SOFTWARE. */")
file(WRITE ${OUT} "#include \"report/viewer/bundle.h\"

namespace mvstudio::report {

std::string_view ViewerScript() {
  return R\"viewer(${licence}\n${script})viewer\";
}

}  // namespace mvstudio::report
")

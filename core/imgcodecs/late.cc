// cv::imdecode and cv::imencode for those who link mvstudio::imgcodecs in place of opencv_imgcodecs: OpenCV's own, from a
// library that is loaded when the first image is read or written. Debian's brings GDAL and some 140 libraries: most of the time
// that a program takes to start.
#include <dlfcn.h>

#include <opencv2/imgcodecs.hpp>
#include <string>

#include "core/error.h"

namespace {

[[noreturn]] void Fail() {
  const char* reason = ::dlerror();
  throw mvstudio::ResourceError(std::string("OpenCV's image codecs cannot be loaded: ") +
                                (reason ? reason : MVSTUDIO_IMGCODECS));
}

void* Symbol(const char* name) {
  void* const library = ::dlopen(MVSTUDIO_IMGCODECS, RTLD_NOW | RTLD_LOCAL);  // a second call counts, and loads nothing
  void* const symbol = library ? ::dlsym(library, name) : nullptr;
  if (symbol == nullptr) Fail();
  return symbol;
}

}  // namespace

// Names as the Itanium C++ ABI has them for the signatures below.
cv::Mat cv::imdecode(InputArray buf, int flags) {
  using Function = Mat (*)(InputArray, int);
  static const auto function = reinterpret_cast<Function>(Symbol("_ZN2cv8imdecodeERKNS_11_InputArrayEi"));
  return function(buf, flags);
}

bool cv::imencode(const String& ext, InputArray img, std::vector<uchar>& buf, const std::vector<int>& params) {
  using Function = bool (*)(const String&, InputArray, std::vector<uchar>&, const std::vector<int>&);
  static const auto function =
      reinterpret_cast<Function>(Symbol("_ZN2cv8imencodeERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEERKNS_11_"
                                        "InputArrayERSt6vectorIhSaIhEERKSB_IiSaIiEE"));
  return function(ext, img, buf, params);
}

#include "body/templates/read.h"

#include <filesystem>

#include "body/makehuman/read.h"
#include "body/smpl/read.h"

namespace mvstudio::body {

BodyTemplate ReadTemplate(const std::string& source) {
  if (source.empty() || source == "mannequin") return MakeMannequin();
  return std::filesystem::is_directory(source) ? ReadMakeHuman(source) : ReadSmpl(source);
}

}  // namespace mvstudio::body

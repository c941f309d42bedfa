#include "avatar/body/templates/read.h"

#include <filesystem>

#include "avatar/body/makehuman/read.h"
#include "avatar/body/smpl/read.h"

namespace mvstudio::body {

BodyTemplate ReadTemplate(const std::string& source) {
  if (source.empty() || source == "mannequin") return MakeMannequin();
  return std::filesystem::is_directory(source) ? ReadMakeHuman(source) : ReadSmpl(source);
}

}  // namespace mvstudio::body

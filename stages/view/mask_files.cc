#include "stages/view/mask_files.h"

#include "core/error.h"
#include "stages/view/scene_parts.h"

namespace mvstudio::stages {

FilesByNumber NumberedFiles(const dataset::FootageFiles& found) {
  FilesByNumber files;
  for (size_t i = 0; i < found.images.numbers.size() && i < found.paths.size(); ++i)
    files.emplace(found.images.numbers[i], found.paths[i]);
  return files;
}

MaskFiles::MaskFiles(const std::string& folder, std::string root) : root_(std::move(root)) {
  if (folder.empty()) return;
  const dataset::FootageFiles found = dataset::ListFootage(folder);
  files_ = NumberedFiles(found);
  for (const auto& [number, path] : files_) RequireInside(path, root_);
  meaning_ = dataset::MeaningOfMasks(found.paths);
}

Image MaskFiles::At(int64_t number) const {
  const auto file = files_.find(number);
  return file == files_.end() ? Image() : dataset::ReadMask(file->second, meaning_);
}

}  // namespace mvstudio::stages

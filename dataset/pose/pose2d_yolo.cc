#include <sstream>

#include "core/text/number_cell.h"
#include "dataset/pose/pose2d_parse.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr size_t kBoxNumbers = 5;  // class, centre and size of the box

/// Numbers of a joint in a line of `count` numbers: x, y and visibility, or x and y; a confidence and a track may follow. 0:
/// none fits.
size_t NumbersOfJoint(size_t count, size_t num_joints) {
  for (const size_t each : {3, 2}) {
    const size_t least = kBoxNumbers + each * num_joints;
    if (count >= least && count <= least + 2) return each;
  }
  return 0;
}

std::vector<double> NumbersOfLine(const std::string& line, const std::string& where, const PoseFile& file) {
  std::istringstream in(line);
  std::vector<double> numbers;
  for (std::string word; in >> word;) {
    const NumberCell cell = ReadNumberCell(word);
    if (cell.kind != NumberCell::Kind::kNumber) file.Fail(where, "`" + word.substr(0, 40) + "` is no number");
    numbers.push_back(cell.value);
  }
  return numbers;
}

Person2d PersonOfLine(const std::vector<double>& numbers, const std::string& where, const PoseFile& file) {
  const size_t num_joints = file.skeleton.joints.size(), each = NumbersOfJoint(numbers.size(), num_joints);
  if (numbers.size() <= kBoxNumbers + 1) file.Fail(where, "a box without joints; labels of a pose model are needed");
  if (each == 0)
    file.Fail(where, std::to_string(numbers.size()) + " numbers, not 5 + 3 x " + std::to_string(num_joints) + " of skeleton " +
                         file.skeleton.name + "; " + FittingSkeletons((numbers.size() - kBoxNumbers) / 3));
  Person2d person;
  for (size_t k = 0; k < num_joints; ++k) {
    const double* const at = &numbers[kBoxNumbers + each * k];
    const bool seen = each == 3 ? at[2] > 0 : at[0] != 0 || at[1] != 0;
    if (seen && (at[0] < -0.5 || at[0] > 1.5 || at[1] < -0.5 || at[1] > 1.5))
      file.Fail(where,
                "joint " + std::to_string(k) + " is not at 0 to 1 of the image's width and height, as YOLO's labels are");
    person.keypoints.push_back(seen ? Keypoint2d{at[0], at[1], each == 3 && at[2] != 2 ? at[2] : 1.0} : Keypoint2d());
  }
  return person;
}

}  // namespace

std::vector<Person2d> ParseYoloLabels(const std::string& text, const PoseFile& file) {
  std::vector<Person2d> people;
  std::istringstream in(text);
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    const std::string where = "line " + std::to_string(++number);
    const std::vector<double> numbers = NumbersOfLine(line, where, file);
    if (!numbers.empty()) people.push_back(PersonOfLine(numbers, where, file));
  }
  return people;
}

}  // namespace mvstudio::dataset::internal

#include "geometry/skeleton/skeleton_text.h"

#include <fstream>

#include "core/error.h"
#include "core/hash/sha256.h"
#include "tests/support/message_of.h"
#include "tests/support/mouse.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

/// Joints, bones, pairs and parts in one line.
std::string Content(const Skeleton& skeleton) {
  std::string text;
  for (const std::string& joint : skeleton.joints) text += (text.empty() ? "" : ",") + joint;
  const auto add_pairs = [&text](const std::vector<std::pair<int, int>>& pairs) {
    text += "|";
    for (size_t i = 0; i < pairs.size(); ++i) {
      text += (i ? "," : "") + std::to_string(pairs[i].first) + "-" + std::to_string(pairs[i].second);
    }
  };
  add_pairs(skeleton.bones), add_pairs(MirrorJoints(skeleton));
  text += "|";
  for (size_t i = 0; i < skeleton.parts.size(); ++i) {
    const SkeletonPart& part = skeleton.parts[i];
    text += (i ? "," : "") + std::to_string(static_cast<int>(part.kind)) + ":" + std::to_string(part.first) + ":" +
            std::to_string(part.count);
  }
  return text;
}

// Digests of what the program knew while its skeletons were code.
TEST(SkeletonText, KnownSkeletonsAreWhatTheyWereAsCode) {
  const std::pair<const char*, const char*> digests[] = {
      {"body25", "6797e351faafd683"},       {"body25b", "c38022f5eca8119d"},       {"body135", "39a417d31512a5b9"},
      {"coco17", "8bf2b7432a4af944"},       {"coco18", "73f7246bc1d32c48"},        {"coco19", "a56a06e9566054b1"},
      {"coco133", "e806cbf27cc153b5"},      {"halpe26", "38f7d5c1ed565d6e"},       {"halpe136", "663c7068c68d7fd1"},
      {"mediapipe33", "672a3ab993b8f8c2"},  {"mediapipe75", "aadd772bdb64c99e"},   {"openpose137", "460fa3bce538a4d8"},
      {"body25+face", "4104bec8613aa80b"},  {"body25+hands", "2da670495020f106"},  {"body25+face+hands", "460fa3bce538a4d8"},
      {"body25b+face", "b711c7dad81563b0"}, {"body25b+hands", "1a4a831979d21f30"}, {"body25b+face+hands", "49abe74ea1416ee0"},
      {"coco18+face", "07944bec80df1a28"},  {"coco18+hands", "bb7b5c422e350ffb"},  {"coco18+face+hands", "82a855643f28b15f"},
  };
  for (const auto& [name, digest] : digests) {
    const std::string text = Content(SkeletonByName(name));
    EXPECT_EQ(Sha256Hex(text.data(), text.size()).substr(0, 16), digest) << name << ": " << text;
    EXPECT_TRUE(SkeletonByName(name).human) << name;
  }
  EXPECT_EQ(SkeletonNames().size(), std::size(digests));
}

TEST(SkeletonText, JsonGivesTheSameSkeleton) {
  std::vector<Skeleton> all = {SkeletonFromToml(MouseToml(), "mouse.toml")};
  for (const std::string& name : SkeletonNames()) all.push_back(SkeletonByName(name));
  for (const Skeleton& skeleton : all) {
    const Skeleton back = SkeletonFromJson(SkeletonToJson(skeleton), "pose3d.json", "definition");
    EXPECT_EQ(Content(back), Content(skeleton));
    EXPECT_EQ(back.name, skeleton.name);
    EXPECT_EQ(back.parents, skeleton.parents) << skeleton.name;
    EXPECT_EQ(back.rest_m, skeleton.rest_m) << skeleton.name;
    EXPECT_EQ(back.colours, skeleton.colours) << skeleton.name;
    EXPECT_EQ(back.up_from, skeleton.up_from) << skeleton.name;
    EXPECT_EQ(back.human, skeleton.human) << skeleton.name;
    ASSERT_EQ(back.lengths.size(), skeleton.lengths.size());
    for (size_t b = 0; b < back.lengths.size(); ++b) {
      EXPECT_EQ(back.lengths[b].min_m, skeleton.lengths[b].min_m);
      EXPECT_EQ(back.lengths[b].max_m, skeleton.lengths[b].max_m);
    }
  }
}

TEST(SkeletonText, AMouseKeepsWhatItsFileSays) {
  const Skeleton mouse = SkeletonFromToml(MouseToml(), "mouse.toml");
  EXPECT_EQ(mouse.joints.size(), 15u);
  EXPECT_EQ(mouse.bones.size(), 14u);
  EXPECT_EQ(MirrorJoints(mouse).size(), 4u);
  const size_t tail = 12;
  EXPECT_EQ(BoneName(mouse, mouse.bones[tail]), "tail_base-tail_mid");
  EXPECT_EQ(mouse.lengths[tail].max_m, 0.22);
  EXPECT_THAT(BoneColours(mouse)[tail], ElementsAre(255, 136, 0));
  const std::vector<int> parents = HierarchyOf(mouse);
  for (size_t j = 0; j < parents.size(); ++j) EXPECT_EQ(parents[j], mvstudio::testing::Mouse()[j].parent) << mouse.joints[j];
}

TEST(SkeletonText, HierarchyReachesJointsWithoutBones) {
  Skeleton skeleton = PointsSkeleton({"a", "b", "c", "d", "alone"});
  skeleton.bones = {{0, 1}, {2, 1}, {2, 3}, {3, 1}};  // a ring and a joint beside it
  EXPECT_THAT(HierarchyOf(skeleton), ElementsAre(1, -1, 1, 1, 1));
}

/// What a file with these lines is refused for; `joints` and `name` are given unless they are among them.
std::string Refusal(const std::string& lines) {
  std::string text = lines;
  if (lines.rfind("joints =", 0) != 0) text = "joints = [\"a\", \"b\", \"c\"]\n" + text;
  if (lines.rfind("name =", 0) != 0) text = "name = \"x\"\n" + text;
  return MessageOf<FormatError>([&] { SkeletonFromToml(text, "x.toml"); });
}

TEST(SkeletonText, HostileFilesAreRefusedByFileAndKey) {
  EXPECT_THAT(Refusal("joints = []"), HasSubstr("x.toml: joints: names no joint"));
  EXPECT_THAT(Refusal("joints = [\"a\", \"a\"]"), HasSubstr("x.toml: joints[1]: 'a' is there twice"));
  EXPECT_THAT(Refusal("bones = [[\"a\", \"z\"]]"), HasSubstr("x.toml: bones[0][1]: 'z' is none of the joints"));
  EXPECT_THAT(Refusal("bones = [[\"a\", \"a\"]]"), HasSubstr("bones[0]: is twice the same joint"));
  EXPECT_THAT(Refusal("bones = [[\"a\", \"b\"], [\"b\", \"a\"]]"), HasSubstr("bones[1]: bone b-a is there twice"));
  EXPECT_THAT(Refusal("bones = [{ joints = [\"a\", \"b\"], length_m = [nan, 1] }]"),
              HasSubstr("bones[0].length_m[0]: must be finite"));
  EXPECT_THAT(Refusal("bones = [{ joints = [\"a\", \"b\"], length_m = [2, 1] }]"), HasSubstr("the second larger"));
  EXPECT_THAT(Refusal("bones = [{ joints = [\"a\", \"b\"], lenght_m = [1, 2] }]"), HasSubstr("bones[0].lenght_m: is no key"));
  EXPECT_THAT(Refusal("bones = [{ joints = [\"a\", \"b\"], colour = \"red\" }]"), HasSubstr("'red' is no colour"));
  EXPECT_THAT(Refusal("pairs = [[\"a\", \"b\"], [\"b\", \"c\"]]"), HasSubstr("pairs[1]: 'b' is in two pairs"));
  EXPECT_THAT(Refusal("parents = { a = \"b\", b = \"c\", c = \"a\" }"), AllOf(HasSubstr("parents"), HasSubstr("circle")));
  EXPECT_THAT(Refusal("parents = { a = \"b\" }"), HasSubstr("these have none: b, c"));
  EXPECT_THAT(Refusal("joints = [\"pawR\", \"pawL\"]\nbones = [[\"pawLeft\", \"pawR\"]]"), HasSubstr("did you mean 'pawL'?"));
  EXPECT_THAT(Refusal("joints = [\"pawR\", \"pawL\"]\nroot = \"tail\""), Not(HasSubstr("did you mean")));
  EXPECT_THAT(Refusal("root = \"z\""), HasSubstr("root: 'z' is none of the joints"));
  EXPECT_THAT(Refusal("rest_m = { a = [0, 0, 1] }"), HasSubstr("rest_m: needs `root` or `parents`"));
  EXPECT_THAT(Refusal("bone = []"), HasSubstr("bone: is no key here"));
  EXPECT_THAT(Refusal("joints = [1]"), HasSubstr("joints[0]: must be a text"));
  EXPECT_THAT(Refusal("name = \"../up\""), HasSubstr("name: '../up'"));
  EXPECT_THAT(Refusal("joints = [\"a\\n\"]"), HasSubstr("control character"));
  EXPECT_THAT(Refusal("joints = [\"a\""), HasSubstr("x.toml: line "));
  EXPECT_THAT(Refusal("joints = [2026-01-01]"), HasSubstr("a date or time"));
  EXPECT_THAT(Refusal("up = { from = [], to = [\"a\"] }"), HasSubstr("up.from: names no joint"));
  EXPECT_THAT(MessageOf<FormatError>([] { SkeletonFromToml("", "x.toml"); }), HasSubstr("x.toml: name: is missing"));
}

TEST(SkeletonText, FilesOfAnySizeAreRefusedInTime) {
  const mvstudio::testing::TempDir folder;
  const auto write = [&](int joints) {
    std::string text = "name = \"many\"\njoints = [";
    for (int j = 0; j < joints; ++j) text += "\"j" + std::to_string(j) + "\",";
    std::ofstream(folder / "many.toml") << text << "]\n";
    return MessageOf<FormatError>([&] { SkeletonFrom(folder / "many.toml"); });
  };
  EXPECT_THAT(write(1001), HasSubstr("joints: names 1001 joints; at most 1000"));
  EXPECT_THAT(write(1'000'000), HasSubstr("is larger than 1 MiB"));
  std::string chain = "name = \"deep\"\njoints = [\"j0\"";  // 1000 joints in a row
  std::string bones;
  for (int j = 1; j < 1000; ++j) {
    chain += ",\"j" + std::to_string(j) + "\"";
    bones += "[\"j" + std::to_string(j - 1) + "\",\"j" + std::to_string(j) + "\"],";
  }
  const Skeleton deep = SkeletonFromToml(chain + "]\nbones = [" + bones + "]\nroot = \"j0\"\n", "deep.toml");
  EXPECT_EQ(HierarchyOf(deep)[999], 998);
}

TEST(SkeletonText, AFileMayNotTakeAKnownName) {
  const mvstudio::testing::TempDir folder;
  std::ofstream(folder / "mouse.toml") << MouseToml();
  EXPECT_EQ(SkeletonFrom(folder / "mouse.toml").name, "mouse");
  std::ofstream(folder / "own.toml") << "name = \"coco17\"\njoints = [\"a\"]\n";
  EXPECT_THAT(MessageOf<FormatError>([&] { SkeletonFrom(folder / "own.toml"); }), HasSubstr("own.toml: name: `coco17`"));
  EXPECT_THROW(SkeletonFrom(folder / "none.toml"), IoError);
  EXPECT_THROW(SkeletonFrom(folder.path() + "/"), IoError);
  EXPECT_THAT(MessageOf<UsageError>([] { SkeletonFrom("mouse"); }), HasSubstr("FILE.toml"));
  EXPECT_EQ(SkeletonFrom("coco17").joints.size(), 17u);
}

}  // namespace
}  // namespace mvstudio::geometry

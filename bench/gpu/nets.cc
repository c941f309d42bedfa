#include "bench/gpu/nets.h"

#include <ATen/ATen.h>

#include "avatar/maps/spread_labels.h"
#include "tests/avatar/synthetic_pack.h"

namespace mvstudio::avatar {
namespace {

ModelOptions WithMethod(ModelOptions options, Method method, Prior prior) {
  options.method = method, options.prior = prior;
  return options;
}

/// Of "High-Fidelity Human Avatars from a Single RGB Camera", with one person's textures.
ModelOptions PaperHf() {
  ModelOptions o = WithMethod({}, Method::kHf, Prior::kTemplate);
  o.width = 64, o.downs = 5, o.skips = false, o.texture_px = 256;
  return o;
}

void AddBodies(AvatarPack* pack) {
  const int64_t size = pack->size_px;
  at::Tensor part = pack->part.clone(), uv = pack->uv.clone();
  for (int64_t i = 0; i < pack->size(); ++i) SpreadLabels(size, nullptr, part[i].data_ptr<uint8_t>(), uv[i].data_ptr<float>());
  const at::Tensor cover = at::avg_pool2d((pack->part > 0).unsqueeze(1).to(at::kFloat), 3, 1, 1);
  pack->template_maps = at::cat({cover, part.unsqueeze(1).to(at::kFloat), uv}, 1).contiguous();
  pack->template_colours = (255 - pack->images).clone();
  const at::Tensor person = (pack->masks > 0).unsqueeze(1);
  pack->references = at::cat({pack->images * person, person.to(at::kByte) * 255}, 1).contiguous();
}

}  // namespace

std::vector<Net> SmallNets() {
  ModelOptions o;
  o.width = 4, o.downs = 2, o.encoder_blocks = o.decoder_blocks = 1, o.texture_px = 8, o.neural_channels = 6;
  ModelOptions paper = o;
  paper.norm = NormLayer::kBatch, paper.upsample = Upsampling::kTransposed, paper.skips = false;
  return {{"TNA", WithMethod(paper, Method::kTna, Prior::kNone), 32, 4},
          {"Direct", WithMethod(paper, Method::kDirect, Prior::kNone), 32, 4},
          {"V2V-lite", WithMethod(o, Method::kV2v, Prior::kTemplate), 32, 4},
          {"HF", WithMethod(o, Method::kHf, Prior::kTemplate), 32, 4},
          {"TNA on the template", WithMethod(o, Method::kTna, Prior::kTemplate), 32, 4}};
}

std::vector<Net> FullNets() {
  return {{"TNA", PaperModel(), 512, 64},
          {"HF", PaperHf(), 512, 64},
          {"Direct", WithMethod(PaperModel(), Method::kDirect, Prior::kNone), 512, 64},
          {"V2V-lite", WithMethod(PaperModel(), Method::kV2v, Prior::kNone), 512, 64},
          {"TNA on the template", WithMethod({}, Method::kTna, Prior::kTemplate), 512, 64}};
}

AvatarPack PackFor(const Net& net, int64_t count) {
  AvatarPack pack = MakeSyntheticPack(count, net.size_px, 1, 0.05);
  if (net.options.prior == Prior::kTemplate) AddBodies(&pack);
  if (!TakesReferences(net.options)) pack.references = at::Tensor();
  if (!CorrectsColours(net.options)) pack.template_colours = at::Tensor();
  return pack;
}

}  // namespace mvstudio::avatar

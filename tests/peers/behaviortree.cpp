// Loads files for Groot2 with BehaviorTree.CPP itself, and says what it understood.
//
// Every node of a file's TreeNodesModel is registered with the ports that stand there, and does
// nothing but succeed. Then the tree is made, told node by node, and ticked to its end.

#include <behaviortree_cpp/bt_factory.h>
#include <tinyxml2.h>

#include <fstream>
#include <iostream>
#include <sstream>

namespace {

BT::PortsList portsOf(const tinyxml2::XMLElement* model) {
  BT::PortsList ports;
  for (auto* port = model->FirstChildElement(); port; port = port->NextSiblingElement()) {
    const std::string kind = port->Name(), name = port->Attribute("name");
    if (kind == "input_port") {
      ports.insert(BT::InputPort<std::string>(name));
    } else if (kind == "output_port") {
      ports.insert(BT::OutputPort<std::string>(name));
    } else {
      throw BT::RuntimeError("a model has a ", kind);
    }
  }
  return ports;
}

void registerModels(BT::BehaviorTreeFactory& factory, const tinyxml2::XMLElement* models) {
  auto succeed = [](BT::TreeNode&) { return BT::NodeStatus::SUCCESS; };
  for (auto* model = models->FirstChildElement(); model; model = model->NextSiblingElement()) {
    const std::string kind = model->Name(), id = model->Attribute("ID");
    if (kind == "Condition") {
      factory.registerSimpleCondition(id, succeed, portsOf(model));
    } else if (kind == "Action") {
      factory.registerSimpleAction(id, succeed, portsOf(model));
    } else {
      throw BT::RuntimeError("a model is a ", kind);
    }
  }
}

void tell(const BT::TreeNode* node) {
  std::cout << node->registrationName() << "\t" << node->name();
  for (const auto& ports : {node->config().input_ports, node->config().output_ports}) {
    for (const auto& [port, value] : ports) {
      const bool key = BT::TreeNode::isBlackboardPointer(value);
      std::cout << "\t" << port << (key ? " is key " : " is ") << value;
    }
  }
  std::cout << "\n";
}

void load(const std::string& text) {
  tinyxml2::XMLDocument document;
  document.Parse(text.c_str());
  BT::BehaviorTreeFactory factory;
  registerModels(factory, document.RootElement()->FirstChildElement("TreeNodesModel"));
  factory.registerBehaviorTreeFromText(text);
  auto tree = factory.createTree(document.RootElement()->Attribute("main_tree_to_execute"));
  tree.applyVisitor([](const BT::TreeNode* node) { tell(node); });
  std::cout << BT::toStr(tree.tickWhileRunning()) << "\n";
}

}  // namespace

int main(int, char** arguments) {
  std::stringstream text;
  text << std::ifstream(arguments[1]).rdbuf();
  try {
    load(text.str());
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
  return 0;
}

"""Contact area: partial contact, S in G, adhesion, and the law fitted to boundary elements."""
